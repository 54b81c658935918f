"""Looks at a piece of furniture before anything is trained on it: what is wrong, what is doubtful, and a picture."""

from tstar_envs.inspection.finding import Finding
from tstar_envs.inspection.findings import inspect
from tstar_envs.inspection.trial import Trial, try_out

__all__ = ["Finding", "Trial", "inspect", "try_out"]
