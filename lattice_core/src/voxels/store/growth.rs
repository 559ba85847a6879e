//! Vectors with little spare capacity.

/// Initial capacity.
pub(crate) const FIRST: usize = 64;

/// Maximum bytes per item in a vector that grows by [`push`], except for the first items.
pub(crate) const fn most_bytes<T>() -> usize {
    size_of::<T>() + size_of::<T>() / 4 + 1
}

/// Appends an item; the vector grows by a quarter instead of doubling, to save memory.
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
