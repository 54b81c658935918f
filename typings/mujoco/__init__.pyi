# MuJoCo's functions and enumerations live in a compiled module without types; everything of it is unknown here.
from typing import Any

def __getattr__(name: str) -> Any: ...
