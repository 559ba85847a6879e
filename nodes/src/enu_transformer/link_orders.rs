//! Stamp order of dynamic transforms, per link.

use nalgebra::Isometry3;
use rustc_hash::FxHashMap;

use super::stamp_order::{Decision, StampOrder};

/// Limit of tracked links; transforms of further ones are accepted in any order.
const MAX_LINKS: usize = 1000;

/// Longest names kept, bytes: more than the transform buffer accepts.
const MAX_NAME_BYTES: usize = 1024;

/// Stamp orders of links from child to parent.
#[derive(Clone, Debug, Default)]
pub(super) struct LinkOrders {
    by_child: FxHashMap<String, Vec<Link>>,
    links: usize,
    ambiguous: usize,
}

#[derive(Clone, Debug)]
struct Link {
    parent: String,
    order: StampOrder<Isometry3<f64>>,
}

impl LinkOrders {
    /// True while an undecided clock step of some link is so small that stamps overlap.
    pub fn is_ambiguous(&self) -> bool {
        self.ambiguous > 0
    }

    /// Handles a transform and returns the decision with the previous newest stamp of its link; `None`: untracked.
    pub fn push(
        &mut self,
        parent: &str,
        child: &str,
        stamp_ns: i64,
        parent_from_child: Isometry3<f64>,
    ) -> Option<(Decision<Isometry3<f64>>, Option<i64>)> {
        // The transform buffer rejects such names.
        if parent.len().max(child.len()) > MAX_NAME_BYTES {
            return None;
        }
        if !self.by_child.contains_key(child) {
            if self.links >= MAX_LINKS {
                return None;
            }
            self.by_child.insert(child.to_owned(), Vec::new());
        }
        let links = self.by_child.get_mut(child)?;
        let at = match links.iter().position(|link| link.parent == parent) {
            Some(at) => at,
            None if self.links >= MAX_LINKS => return None,
            None => {
                self.links += 1;
                links.push(Link {
                    parent: parent.to_owned(),
                    // A link may pause for any time.
                    order: StampOrder::new(i64::MAX),
                });
                links.len() - 1
            }
        };
        let order = &mut links.get_mut(at)?.order;
        let (newest_ns, was) = (order.newest_ns(), order.is_ambiguous());
        let decision = order.push(stamp_ns, parent_from_child);
        match (was, order.is_ambiguous()) {
            (false, true) => self.ambiguous += 1,
            (true, false) => self.ambiguous = self.ambiguous.saturating_sub(1),
            _ => {}
        }
        Some((decision, newest_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_link_has_an_order_of_its_own_and_their_number_is_bounded() {
        let mut orders = LinkOrders::default();
        let mut push = |parent: &str, child: &str, stamp_ns| {
            let pushed = orders.push(parent, child, stamp_ns, Isometry3::identity());
            (
                pushed.map(|(decision, newest_ns)| (decision.taken.len(), newest_ns)),
                orders.is_ambiguous(),
            )
        };
        for i in 0..20_i64 {
            push("odom", "base", i * 10_000_000);
        }
        let newest_ns = Some(190_000_000);
        assert_eq!(
            push("odom", "base", 55_000_000),
            (Some((0, newest_ns)), true)
        );
        assert_eq!(push("map", "base", 5), (Some((1, None)), true));
        assert_eq!(
            push("odom", "base", 200_000_000),
            (Some((1, newest_ns)), false)
        );
        let long = "n".repeat(MAX_NAME_BYTES + 1);
        assert_eq!(push(&long, "base", 1), (None, false));
        assert_eq!(push("base", &long, 1), (None, false));
        for i in 0..MAX_LINKS {
            push("base", &format!("joint{i}"), 1);
        }
        assert_eq!(push("base", "one too many", 1), (None, false));
        assert_eq!(
            push("odom", "base", 210_000_000).0,
            Some((1, Some(200_000_000)))
        );
    }
}
