/// What speaks for something, added up over steps: what flickers never convinces.
#[derive(Clone, Copy, Debug)]
pub(super) struct Suspicion {
    sum: f64,
    doubt: f64,
    convinced: f64,
}

impl Suspicion {
    /// What a step says counts beyond `doubt`, and together must come to `convinced`.
    pub(super) const fn new(doubt: f64, convinced: f64) -> Self {
        Self {
            sum: 0.0,
            doubt,
            convinced,
        }
    }

    /// Adds what a step says, 0..=1; whether it convinces, upon which it begins anew.
    pub(super) fn add(&mut self, support: f64) -> bool {
        self.sum = (self.sum + support - self.doubt).max(0.0);
        let convinces = self.sum >= self.convinced;
        if convinces {
            self.forget();
        }
        convinces
    }

    /// Begins anew.
    pub(super) fn forget(&mut self) {
        self.sum = 0.0;
    }
}
