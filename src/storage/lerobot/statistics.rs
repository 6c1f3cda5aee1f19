//! Statistics of the columns of a dataset, which training programs normalise by.

use serde_json::{Value, json};

use crate::trajectory::Image;

/// Least, greatest, mean and spread of the values of one column, dimension by dimension.
#[derive(Clone, Debug, Default)]
pub(super) struct Statistics {
    count: u64,
    dimensions: Vec<Moments>,
}

#[derive(Clone, Copy, Debug)]
struct Moments {
    min: f64,
    max: f64,
    mean: f64,
    /// Sum of squared distances from the mean.
    squares: f64,
    count: f64,
}

impl Default for Moments {
    fn default() -> Self {
        Self {
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
            mean: 0.0,
            squares: 0.0,
            count: 0.0,
        }
    }
}

impl Moments {
    /// Takes a value in (Welford).
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        self.min = self.min.min(value);
        self.max = self.max.max(value);
        let before = value - self.mean;
        self.mean += before / self.count;
        self.squares += before * (value - self.mean);
    }

    /// Takes in what others have counted (Chan).
    fn merge(&mut self, other: &Self) {
        if other.count == 0.0 {
            return;
        }
        let count = self.count + other.count;
        let distance = other.mean - self.mean;
        self.mean += distance * other.count / count;
        self.squares += other.squares + distance * distance * self.count * other.count / count;
        self.count = count;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    fn spread(&self) -> f64 {
        (self.squares / self.count.max(1.0)).sqrt()
    }
}

impl Statistics {
    /// Takes a row in.
    pub fn add(&mut self, values: &[f64]) {
        self.count += 1;
        self.dimensions
            .resize(values.len().max(self.dimensions.len()), Moments::default());
        for (moments, value) in self.dimensions.iter_mut().zip(values) {
            moments.add(*value);
        }
    }

    /// Takes all pixels of an image in, a channel a dimension, from 0 to 1.
    pub fn add_image(&mut self, image: &Image) {
        self.count += 1;
        self.dimensions.resize(3, Moments::default());
        for (channel, moments) in self.dimensions.iter_mut().enumerate() {
            // Sums of bytes are exact, and a thousand times faster than one moment a pixel.
            let (mut sum, mut squares, mut min, mut max) = (0u64, 0u64, u8::MAX, u8::MIN);
            for value in image.rgb()[channel..].iter().step_by(3) {
                sum += u64::from(*value);
                squares += u64::from(*value) * u64::from(*value);
                min = min.min(*value);
                max = max.max(*value);
            }
            let count = (image.rgb().len() / 3) as f64;
            let mean = sum as f64 / count;
            moments.merge(&Moments {
                min: f64::from(min) / 255.0,
                max: f64::from(max) / 255.0,
                mean: mean / 255.0,
                squares: (squares as f64 - mean * sum as f64).max(0.0) / (255.0 * 255.0),
                count,
            });
        }
    }

    /// As `meta/stats.json` has them; of images with the shape `[3, 1, 1]`.
    pub fn to_json(&self, is_image: bool) -> Value {
        let list = |of: fn(&Moments) -> f64| -> Value {
            let values = self.dimensions.iter().map(of);
            if is_image {
                values.map(|v| json!([[v]])).collect()
            } else {
                values.map(|v| json!(v)).collect()
            }
        };
        json!({
            "min": list(|m| m.min),
            "max": list(|m| m.max),
            "mean": list(|m| m.mean),
            "std": list(Moments::spread),
            "count": [self.count],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_by_hand() {
        let mut statistics = Statistics::default();
        for value in [1.0, 2.0, 6.0] {
            statistics.add(&[value, -value]);
        }
        let json = statistics.to_json(false);
        assert_eq!(json["mean"], json!([3.0, -3.0]));
        assert_eq!(json["min"], json!([1.0, -6.0]));
        let spread = json["std"][0].as_f64().unwrap();
        assert!((spread - (14.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(json["count"], json!([3]));
    }

    #[test]
    fn pixels_of_several_images_count_alike() {
        let mut statistics = Statistics::default();
        let plain = |v: u8| Image::new(1, 2, vec![v, 0, 255, v, 0, 255]).unwrap();
        statistics.add_image(&plain(0));
        statistics.add_image(&plain(255));
        let json = statistics.to_json(true);
        assert_eq!(json["mean"], json!([[[0.5]], [[0.0]], [[1.0]]]));
        assert_eq!(json["std"], json!([[[0.5]], [[0.0]], [[0.0]]]));
        assert_eq!(json["count"], json!([2]));
    }
}
