"""Occupied voxel maps on lattices, and registration."""

from ._core import *
from ._core import __all__, __version__
