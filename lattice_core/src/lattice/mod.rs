//! Lattices: generators, exact quantizers, neighbours, Voronoi cells and keys.
