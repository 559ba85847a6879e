//! Stamps held against their neighbours, so that a single wrong one moves no clock.

/// Lets stamps pass that are near the one before; one that jumps is refused until several in a row agree
/// on the new time, as those of a log that loops do.
#[derive(Clone, Debug)]
pub struct StampGate {
    back_ns: i64,
    ahead_ns: i64,
    agreeing: u32,
    last_ns: Option<i64>,
    /// Last of the stamps in a row that were refused, and their number.
    refused: Option<(i64, u32)>,
}

impl StampGate {
    /// A gate for steps of at most so much; of stamps beyond them the `agreeing`th in a row passes.
    pub fn new(back_ns: i64, ahead_ns: i64, agreeing: u32) -> Self {
        Self {
            back_ns,
            ahead_ns,
            agreeing,
            last_ns: None,
            refused: None,
        }
    }

    /// True until a stamp has passed: the next is held against nothing.
    pub fn is_new(&self) -> bool {
        self.last_ns.is_none()
    }

    /// True if a stamp is to be believed.
    pub fn passes(&mut self, stamp_ns: i64) -> bool {
        let near = |at_ns: i64| {
            let step_ns = stamp_ns.saturating_sub(at_ns);
            (-self.back_ns..=self.ahead_ns).contains(&step_ns)
        };
        let Some(last_ns) = self.last_ns.filter(|last_ns| !near(*last_ns)) else {
            (self.last_ns, self.refused) = (Some(stamp_ns), None);
            return true;
        };
        // Steps wider than the limits agree too where they are small against the jump: a slow sensor.
        let run = match self.refused {
            Some((at_ns, run)) if stamp_ns.abs_diff(at_ns) < stamp_ns.abs_diff(last_ns) => run + 1,
            _ => 1,
        };
        self.refused = Some((stamp_ns, run));
        if run < self.agreeing {
            return false;
        }
        (self.last_ns, self.refused) = (Some(stamp_ns), None);
        true
    }

    /// Forgets all stamps.
    pub fn clear(&mut self) {
        (self.last_ns, self.refused) = (None, None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_jumps_alone_is_refused_and_what_agrees_passes_in_bounded_time() {
        let mut gate = StampGate::new(1, 10, 3);
        let year = i64::MAX;
        let mut passed = |stamps: &[i64]| -> Vec<bool> {
            stamps.iter().map(|stamp| gate.passes(*stamp)).collect()
        };
        assert_eq!(
            passed(&[0, 10, 9, year, 11]),
            [true, true, true, false, true]
        );
        // A clock that is wrong now and then, and one that always is, among others.
        let among = [year, 12, year, 13, year, year, 14, i64::MIN, 15];
        let refused = passed(&among).iter().filter(|passed| !**passed).count();
        assert_eq!(refused, 5);
        // Time set back, and ahead with a slow sensor.
        assert_eq!(passed(&[-100, -99, -98, -97]), [false, false, true, true]);
        assert_eq!(passed(&[900, 950, 1000, 1010]), [false, false, true, true]);
    }
}
