"""Occupied voxel maps on lattices, and registration.

Points are NumPy arrays of shape (n, 3), float32 or float64, metres; contiguous rows are read without a copy.
An invalid value raises ValueError with the numbers, a wrong type TypeError, an error of the system OSError.
"""

from os import PathLike
from typing import Any, Literal, Sequence, SupportsIndex, TypedDict, final, type_check_only

import numpy as np
import numpy.typing as npt

__all__ = [
    "Calibration",
    "Lattice",
    "Registration",
    "Table",
    "VoxelMap",
    "__version__",
    "calibrate",
    "gicp",
    "read_points",
    "write_points",
]

__version__: str

@type_check_only
class InsertReport(TypedDict):
    points: int
    inserted: int
    masked: int
    not_finite: int
    out_of_range: int
    list_full: int
    new_voxels: int

@final
class Lattice:
    """Lattice of cells of one volume."""

    def __new__(cls, name: Literal["cubic", "bcc", "fcc", "mcc", "hex", "hexopt"], volume: float) -> Lattice: ...
    @property
    def name(self) -> str: ...
    @property
    def cell_volume_m3(self) -> float: ...
    @property
    def generator(self) -> npt.NDArray[np.float64]:
        """Generator matrix, shape (3, 3); columns are basis vectors, m."""
    def quantize(self, xyz: npt.ArrayLike, *, out: npt.NDArray[np.int32] | None = None) -> npt.NDArray[np.int32]:
        """Lattice indices of the cells of points, shape (n, 3); written to `out` (C order) if given, which is returned."""
    def centers(self, cells: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Centres of cells by their lattice indices, shape (n, 3), m."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Table:
    """Rows of a map for pyarrow, Polars and DuckDB."""

    @property
    def column_names(self) -> list[str]: ...
    def __len__(self) -> int: ...
    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...

@final
class VoxelMap:
    """Occupied voxels of a lattice. Threads may share a map."""

    __hash__: None  # type: ignore[assignment]
    def __new__(
        cls,
        lattice: Lattice,
        datum: Sequence[float] = ...,
        *,
        labels: bool = False,
        stamps: bool = False,
        colors: bool = False,
        max_voxels: int = ...,
    ) -> VoxelMap: ...
    @property
    def lattice(self) -> Lattice: ...
    @property
    def datum(self) -> tuple[float, float, float]: ...
    @property
    def points(self) -> int: ...
    def __len__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def insert(
        self,
        xyz: npt.ArrayLike,
        labels: npt.ArrayLike | None = None,
        stamps: npt.ArrayLike | None = None,
        colors: npt.ArrayLike | None = None,
    ) -> InsertReport:
        """Adds points, with one label (-1 for none) and colour (uint8 of shape (n, 3)) per point and a stamp (ns, or
        datetime64) per point or for all.

        Rows with a masked value are dropped and counted. An interrupted call has added some of the points.
        """
    def merge(self, other: VoxelMap) -> None:
        """Adds all voxels of another map of the same cells, exactly."""
    def crop(self, low: Sequence[float], high: Sequence[float]) -> VoxelMap:
        """Map of the voxels whose centres are in the closed box between two corners, m."""
    def to_arrow(self) -> Table: ...
    @staticmethod
    def from_arrow(table: object, *, lattice: Lattice | None = None, datum: Sequence[float] | None = None) -> VoxelMap:
        """Creates a map from a table of cells; `lattice`, and optionally `datum` (m), replace dropped metadata."""
    @staticmethod
    def load(path: str | PathLike[str]) -> VoxelMap: ...
    def save(self, path: str | PathLike[str], zstd: int | None = None) -> None:
        """Writes a map file; after an error the previous file stays."""
    def query(self, xyz: npt.ArrayLike, k: SupportsIndex = 1) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Distances, shape (n, k), and centres, shape (n, k, 3), of the nearest occupied cells, m; fewer if there are fewer cells."""
    def centers(self) -> npt.NDArray[np.float64]: ...
    def cells(self) -> npt.NDArray[np.int64]: ...
    def counts(self) -> npt.NDArray[np.uint32]: ...
    def means(self) -> npt.NDArray[np.float64]:
        """Mean of the points of each cell, shape (n, 3), m."""
    def labels(self) -> npt.NDArray[np.int32]:
        """Most frequent label of each cell, -1 without one."""
    def stamps(self) -> npt.NDArray[np.datetime64]:
        """Stamps of the first and the last point of each cell, datetime64[ns] of shape (n, 2)."""
    def colors(self) -> npt.NDArray[np.uint8]:
        """Mean red, green and blue of the coloured points of each cell, shape (n, 3); 0 without them."""
    def color_counts(self) -> npt.NDArray[np.uint32]:
        """Number of coloured points of each cell."""

@final
class Registration:
    """Result of a single registration."""

    @property
    def target_from_source(self) -> npt.NDArray[np.float64]: ...
    @property
    def covariance(self) -> npt.NDArray[np.float64]:
        """Covariance of x, y, z (m^2) and of the rotations about x, y, z (rad^2) in the target, shape (6, 6); for a
        source more than 100 m from its origin, x, y, z refer to its centroid."""
    @property
    def hessian(self) -> npt.NDArray[np.float64]:
        """Half the Hessian of the cost by a translation (m), then a rotation (rad) in the source, about the same point, shape (6, 6)."""
    @property
    def converged(self) -> bool: ...
    @property
    def iterations(self) -> int: ...
    @property
    def inliers(self) -> int: ...
    @property
    def rmse_m(self) -> float: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Calibration:
    """Pose of a cloud in a map, with its verdict."""

    @property
    def verdict(self) -> Literal["OK", "AMBIGUOUS", "DEGENERATE", "NO_OVERLAP", "REJECTED_INPUT"]: ...
    @property
    def reason(self) -> str: ...
    @property
    def map_from_cloud(self) -> npt.NDArray[np.float64]: ...
    @property
    def covariance(self) -> npt.NDArray[np.float64]: ...
    @property
    def p_wrong(self) -> float: ...
    @property
    def inlier_fraction(self) -> float: ...
    @property
    def rmse_m(self) -> float: ...
    @property
    def method(self) -> str: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def gicp(
    source: npt.ArrayLike,
    target: npt.ArrayLike,
    init: npt.ArrayLike | None = None,
    *,
    max_distance: float = 1.0,
    cell: float | None = None,
    num_neighbors: int = 10,
    num_threads: int | None = None,
    max_iterations: int = 20,
) -> Registration:
    """Registers `source` to `target` by GICP; `cell` downsamples both first, m."""

def calibrate(
    map: VoxelMap,
    xyz: npt.ArrayLike,
    labels: npt.ArrayLike | None = None,
    *,
    sensor: Sequence[float] | None = None,
    start: npt.ArrayLike | None = None,
    profile: Literal["headset", "lidar", "depth_camera"] = "headset",
) -> Calibration:
    """Registers a cloud in a map without an initial guess, with a verdict."""

def read_points(path: str | PathLike[str]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32] | None]:
    """Reads the points of a .ply or .pcd file, m, untransformed, and their labels (-1 for none) if it has a field `label`."""

def write_points(path: str | PathLike[str], xyz: npt.ArrayLike, labels: npt.ArrayLike | None = None) -> None:
    """Writes points, m, and their labels (-1 for none) to a binary .ply or .pcd file; after an error the previous file stays.

    PCD is float32 if all coordinates are below 4096 m, exact to 0.25 mm; Open3D reads only float32."""
