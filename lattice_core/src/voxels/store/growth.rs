//! Vectors that keep little room to spare.

/// Items that there is room for at first.
pub(crate) const FIRST: usize = 64;

/// Most bytes for an item in a vector that grows by [`push`], but for the first.
pub(crate) const fn most_bytes<T>() -> usize {
    size_of::<T>() + size_of::<T>() / 4 + 1
}

/// Appends an item. The vector grows by a quarter instead of twofold: the memory held counts.
#[inline(always)]
pub(crate) fn push<T>(vec: &mut Vec<T>, item: T) {
    if vec.len() == vec.capacity() {
        reserve(vec);
    }
    vec.push(item);
}

#[cold]
fn reserve<T>(vec: &mut Vec<T>) {
    vec.reserve_exact((vec.len() / 4).max(FIRST));
}
