//! Vectors that keep little room to spare.

/// Appends an item. The vector grows by a quarter instead of twofold: the memory held counts.
#[inline(always)]
pub(super) fn push<T>(vec: &mut Vec<T>, item: T) {
    if vec.len() == vec.capacity() {
        reserve(vec);
    }
    vec.push(item);
}

#[cold]
fn reserve<T>(vec: &mut Vec<T>) {
    vec.reserve_exact((vec.len() / 4).max(64));
}
