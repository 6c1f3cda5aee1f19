use super::Controller;
use crate::graph::NodeId;
use crate::planner::{GoalChoice, Join, Localisation, Search};

impl Controller<'_> {
    /// The goal states that follow from where the robot may be, with their weights: a belief over
    /// several states is not settled by taking the first of them.
    pub(super) fn goal_states(
        &self,
        localisation: &Localisation,
        goal: &GoalChoice,
    ) -> Vec<(NodeId, f64)> {
        let options = self.planner.options();
        let one = vec![(goal.node, 1.0)];
        if options.search != Search::InOrder
            || options.join != Join::Believed
            || localisation.is_lost
        {
            return one;
        }
        let places = self
            .monitor
            .filter()
            .most_probable_places(self.options.hypotheses);
        let goals: Vec<(NodeId, f64)> = places
            .into_iter()
            .filter_map(|(place, weight)| {
                let goal = self
                    .planner
                    .goal_from(place, localisation, &self.run.distances)?;
                Some((goal.node, weight))
            })
            .collect();
        if goals.is_empty() { one } else { goals }
    }
}
