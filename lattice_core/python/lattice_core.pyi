"""Occupied voxel maps on lattices, and registration.

Points are NumPy arrays of shape (n, 3), float32 or float64, metres; float32 rows in one block are read
where they are. What is refused is a ValueError with the numbers.
"""

from os import PathLike
from typing import Any, Literal, Sequence, TypedDict, final

import numpy as np
import numpy.typing as npt

Points = npt.NDArray[np.float32] | npt.NDArray[np.float64]

class InsertReport(TypedDict):
    points: int
    inserted: int
    not_finite: int
    out_of_range: int
    list_full: int
    new_voxels: int

@final
class Lattice:
    """A lattice of cells of one volume."""

    def __new__(cls, name: Literal["cubic", "bcc", "fcc", "mcc", "hex", "hexopt"], volume: float) -> Lattice: ...
    @property
    def name(self) -> str: ...
    @property
    def cell_volume_m3(self) -> float: ...
    @property
    def generator(self) -> npt.NDArray[np.float64]:
        """Generator matrix, shape (3, 3); columns are basis vectors, m."""
    def quantize(self, xyz: Points, *, out: npt.NDArray[np.int32] | None = None) -> npt.NDArray[np.int32]:
        """Lattice indices of the cells of points, shape (n, 3); written to `out` where given, which is returned."""
    def centers(self, cells: npt.NDArray[np.integer[Any]]) -> npt.NDArray[np.float64]:
        """Centres of cells by their lattice indices, shape (n, 3), m."""

@final
class Table:
    """Rows of a map for pyarrow, Polars and DuckDB."""

    @property
    def column_names(self) -> list[str]: ...
    def __len__(self) -> int: ...
    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...

@final
class VoxelMap:
    """The occupied voxels of a lattice."""

    def __new__(
        cls,
        lattice: Lattice,
        datum: Sequence[float] = ...,
        *,
        labels: bool = False,
        stamps: bool = False,
        max_voxels: int = ...,
    ) -> VoxelMap: ...
    @property
    def lattice(self) -> Lattice: ...
    @property
    def points(self) -> int: ...
    def __len__(self) -> int: ...
    def insert(
        self,
        xyz: Points,
        labels: npt.NDArray[np.integer[Any]] | None = None,
        stamps: npt.NDArray[np.integer[Any]] | int | None = None,
    ) -> InsertReport:
        """Adds points, with a label for each and a stamp (ns) for each or for all."""
    def merge(self, other: VoxelMap) -> None:
        """Adds all voxels of another map of the same cells, exactly."""
    def to_arrow(self) -> Table: ...
    @staticmethod
    def from_arrow(table: object) -> VoxelMap: ...
    @staticmethod
    def load(path: str | PathLike[str]) -> VoxelMap: ...
    def save(self, path: str | PathLike[str], zstd: int | None = None) -> None: ...
    def query(self, xyz: Points, k: int = 1) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Distances, shape (n, k), and centres, shape (n, k, 3), of the nearest occupied cells, m."""
    def centers(self) -> npt.NDArray[np.float64]: ...
    def cells(self) -> npt.NDArray[np.int64]: ...
    def counts(self) -> npt.NDArray[np.uint32]: ...

@final
class Registration:
    """Result of a single registration."""

    target_from_source: npt.NDArray[np.float64]
    converged: bool
    iterations: int
    inliers: int
    rmse_m: float

@final
class Calibration:
    """Pose of a cloud in a map, and whether it can be trusted."""

    verdict: Literal["OK", "AMBIGUOUS", "DEGENERATE", "NO_OVERLAP", "REJECTED_INPUT"]
    reason: str
    map_from_cloud: npt.NDArray[np.float64]
    covariance: npt.NDArray[np.float64]
    p_wrong: float
    inlier_fraction: float
    rmse_m: float
    method: str

def gicp(
    source: Points,
    target: Points,
    init: npt.NDArray[np.float64] | None = None,
    *,
    max_distance: float = 1.0,
    cell: float | None = None,
) -> Registration:
    """Registers points to others by GICP; `cell` thins both first, m."""

def calibrate(
    map: VoxelMap,
    xyz: Points,
    labels: npt.NDArray[np.integer[Any]] | None = None,
    *,
    sensor: Sequence[float] | None = None,
    start: npt.NDArray[np.float64] | None = None,
    profile: Literal["headset", "lidar", "depth_camera"] = "headset",
) -> Calibration:
    """Finds where a cloud lies in a map, without a guess, and judges the answer."""
