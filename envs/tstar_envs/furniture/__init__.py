"""Furniture as data: the schema of a piece of furniture and the library that reads the files in `data/`."""

from tstar_envs.furniture.errors import FurnitureError
from tstar_envs.furniture.library import load, names
from tstar_envs.furniture.schema import Furniture

__all__ = ["Furniture", "FurnitureError", "load", "names"]
