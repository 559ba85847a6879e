//! Check of stamps against their predecessors, so that a single wrong stamp does not move a clock.

/// Passes stamps near the previous one. A jump is rejected until several stamps in a row agree
/// on the new time, as in a looping log.
#[derive(Clone, Debug)]
pub struct StampGate {
    back_ns: i64,
    ahead_ns: i64,
    agreeing: u32,
    last_ns: Option<i64>,
    /// Last consecutive rejected stamp, and the number of them.
    refused: Option<(i64, u32)>,
}

impl StampGate {
    /// Gate for bounded steps; beyond the bounds the `agreeing`th stamp in a row passes.
    pub fn new(back_ns: i64, ahead_ns: i64, agreeing: u32) -> Self {
        Self {
            back_ns,
            ahead_ns,
            agreeing,
            last_ns: None,
            refused: None,
        }
    }

    /// True until a stamp has passed: the next one is not checked.
    pub fn is_new(&self) -> bool {
        self.last_ns.is_none()
    }

    /// True if a stamp is accepted.
    pub fn passes(&mut self, stamp_ns: i64) -> bool {
        let near = |at_ns: i64| {
            let step_ns = stamp_ns.saturating_sub(at_ns);
            (-self.back_ns..=self.ahead_ns).contains(&step_ns)
        };
        let Some(last_ns) = self.last_ns.filter(|last_ns| !near(*last_ns)) else {
            (self.last_ns, self.refused) = (Some(stamp_ns), None);
            return true;
        };
        // Steps beyond the limits agree if they are small against the jump: a slow sensor.
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

    /// Drops all stamps.
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
