use super::FilterOptions;

/// What speaks for each stage to be reached: that it is believed, and that the classifier sees it or, where
/// there is none, that the robot sees what it should.
pub(super) fn support(reached: &[f64], sensed: Option<&[f64]>, fit: f64) -> Vec<f64> {
    let seen = |stage: usize| sensed.map_or(fit, |sensed| sensed[stage]);
    let stages = reached.iter().enumerate();
    stages
        .map(|(stage, believed)| believed * seen(stage))
        .collect()
}

/// How well the distances from and to a state fit with the robot being at it: both are one step
/// for the state itself, and more or less so for its neighbours.
pub(super) fn likelihood(options: &FilterOptions, to: Option<&[f32]>, from: Option<&[f32]>) -> f64 {
    let near = |row: Option<&[f32]>| {
        let Some(row) = row else { return 0.0 };
        let mut weight = 1.0;
        let mut sum = 0.0;
        for p in &row[..row.len() - 1] {
            sum += weight * f64::from(*p);
            weight *= 0.4;
        }
        sum
    };
    let both = (options.floor + near(to)) * (options.floor + near(from));
    both.powf(options.evidence_weight)
}
