//! Paths between frames over a common ancestor.

/// Maximum number of visited ancestors.
const MAX_ABOVE: usize = 32;

/// Ancestor of a frame; small, since every lookup makes two lists of them.
#[derive(Clone, Copy, Debug, Default)]
struct Step {
    frame: u32,
    /// Index of the frame below.
    from: u8,
    depth: u8,
}

/// Frame and its ancestors, the nearest first.
#[derive(Clone, Debug)]
struct Above {
    steps: [Step; MAX_ABOVE],
    len: usize,
}

impl Above {
    fn of<P: Iterator<Item = usize>>(frame: usize, parents: impl Fn(usize) -> P) -> Self {
        let mut above = Self {
            steps: [Step::default(); MAX_ABOVE],
            len: 0,
        };
        above.push(frame, 0, 0);
        let mut at = 0;
        while let Some(step) = above.steps().get(at).copied() {
            for frame in parents(step.frame as usize) {
                if above.place(frame).is_none() {
                    above.push(frame, at, step.depth + 1);
                }
            }
            at += 1;
        }
        above
    }

    fn push(&mut self, frame: usize, from: usize, depth: u8) {
        if let (Some(slot), Ok(frame)) = (self.steps.get_mut(self.len), u32::try_from(frame)) {
            // An index is below `MAX_ABOVE`.
            let from = from as u8;
            *slot = Step { frame, from, depth };
            self.len += 1;
        }
    }

    fn steps(&self) -> &[Step] {
        self.steps.get(..self.len).unwrap_or(&[])
    }

    fn place(&self, frame: usize) -> Option<usize> {
        let mut steps = self.steps().iter();
        steps.position(|step| step.frame as usize == frame)
    }

    /// Links (frame, parent) from an index down to the first frame.
    fn down(&self, mut place: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        std::iter::from_fn(move || {
            let upper = self.steps().get(place).filter(|_| place > 0)?;
            place = usize::from(upper.from);
            let lower = self.steps().get(place)?;
            Some((lower.frame as usize, upper.frame as usize))
        })
    }
}

/// Path between two frames over their common ancestor.
#[derive(Clone, Debug)]
pub(super) struct Path {
    target: Above,
    source: Above,
    /// Indices of the ancestor in both lists.
    ancestor: [usize; 2],
}

impl Path {
    /// Shortest path; of equally short ones the one with the fewest links from the source.
    pub fn find<P: Iterator<Item = usize>>(
        target: usize,
        source: usize,
        parents: impl Fn(usize) -> P,
    ) -> Option<Self> {
        let (target, source) = (Above::of(target, &parents), Above::of(source, &parents));
        let common = source.steps().iter().enumerate().filter_map(|(at, step)| {
            let place = target.place(step.frame as usize)?;
            let depth = target.steps().get(place)?.depth + step.depth;
            Some((depth, [place, at]))
        });
        let (_, ancestor) = common.min_by_key(|(depth, _)| *depth)?;
        Some(Self {
            target,
            source,
            ancestor,
        })
    }

    /// Links (frame, parent) from the ancestor down to the target.
    pub fn to_target(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.target.down(self.ancestor[0])
    }

    /// Links (frame, parent) from the ancestor down to the source.
    pub fn to_source(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.source.down(self.ancestor[1])
    }
}
