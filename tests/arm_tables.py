"""Tables of an experiment's arms and of the skills that they are made of, written by hand."""

from pathlib import Path

import numpy as np
import pandas as pd
import yaml


def write_arm(
    root: Path,
    arm: str,
    seed: int,
    shares: list[float],
    commit: str | None = "a" * 40,
    skills="skills",
    **more,
) -> None:
    """A run of 20 episodes, of which `shares` completed each subtask; sampled actions complete nothing."""
    folder = root / "table" / arm / f"seed{seed}"
    folder.mkdir(parents=True)
    rows = []
    for checkpoint in ("last", "best"):
        for mode, factor in (("deterministic", 1), ("stochastic", 0)):
            done = [factor * share for share in shares]
            row = {"checkpoint": checkpoint, "mode": mode, "episodes": 20, "progress": np.mean(done)}
            row |= {"success": done[-1], "success_low": 0.0, "success_high": 1.0}
            rows.append(
                row | {f"subtask_{k}": share for k, share in enumerate(done)} | {"seed": seed, **more}
            )
    pd.DataFrame(rows).assign(env_steps=1e6, minutes=2).to_csv(folder / "evaluation.csv", index=False)
    if commit:
        (folder / "config.yaml").write_text(
            yaml.safe_dump({"skills": skills, "versions": {"commit": commit}})
        )


def write_skills(
    root: Path, seed: int, own: list[float], system: str = "skills", commit: str = "a" * 40
) -> None:
    for subtask, success in enumerate(own):
        folder = root / "table" / system / f"seed{seed}" / f"subtask{subtask}"
        folder.mkdir(parents=True)
        row = {
            "checkpoint": "last",
            "mode": "deterministic",
            "success": success,
            "seed": seed,
            "episodes": 20,
        }
        pd.DataFrame([row]).to_csv(folder / "evaluation.csv", index=False)
        (folder / "config.yaml").write_text(yaml.safe_dump({"versions": {"commit": commit}}))
