"""Makes a small file of a trained chain: its policies, and what is known of them. `load_pretrained` reads it.

    python recipes/ship.py system=tstar seed=0                       # into runs/shipped/table_lack/tstar
    python recipes/ship.py system=floored scale=narrow variant=narrow_mended into=tstar_rl/shipped/chains
    python recipes/evaluate.py pretrained=table_lack pretrained_dir=runs/shipped  # to the figures recorded

The chain must have been evaluated: its settings, commit and figures are those beside its results.
"""

import re
from pathlib import Path
from typing import Any

import pandas as pd
from omegaconf import DictConfig

from tstar_rl.chaining.chain import chain_folders, chain_record
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import MissingFileError
from tstar_rl.config.check import ConfigError
from tstar_rl.config.load import recipe
from tstar_rl.config.recovery import refuse_recovery
from tstar_rl.config.values import plain
from tstar_rl.launch.overrides import chosen_scale
from tstar_rl.launch.run_folders import evaluated_runs, of_an_earlier_training, run_folder
from tstar_rl.runs.csv_tables import read_table
from tstar_rl.runs.mismatch import FURNITURE, CheckpointMismatchError, differences
from tstar_rl.runs.run_config import read_config
from tstar_rl.runs.run_folder import is_untrained, made_by
from tstar_rl.shipped.chain import save_shipped

FIGURES = ("episodes", "progress", "success", "success_low", "success_high", "episode_length")
SAME = ("task", "env", "networks", "training")
"""Sections in which the run's config must be the one given here, so that the scale recorded is the run's."""


@recipe("ship", checkpoint=str, variant=str, says=str, signal=bool, into=str)
def main(config: DictConfig) -> None:
    """Writes the file and says how large it is."""
    _check_variant(config)
    folders = _folders(config)
    same = {"task": config.task.name, "chain": chain_record(folders[0])}  # not halves of two chains
    skills = [Skill.load(folder, subtask=i, **same) for i, folder in enumerate(folders)]
    results = run_folder(config, "results_dir")
    saved, figures = _config_of(results, config), _figures_of(results, config)
    path = Path(config.into) / config.task.name / config.variant
    save_shipped(
        skills, path, config.signal, task=config.task.name, variant=config.variant, says=config.says,
        system=config.system, scale=chosen_scale(), seed=config.seed,
        checkpoint=config.checkpoint, figures=figures, **saved,
    )  # fmt: skip
    size = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    print(f"{path}: {len(skills)} skills, {size / 1000:.0f} kB")
    print(pd.DataFrame(figures).T.round(3).to_string())


def _check_variant(config: DictConfig) -> None:
    """Refuses a name under which no chain is found, as that of a system in folders is."""
    if not re.fullmatch(r"\w[\w.-]*", config.variant):
        raise ConfigError(
            f"variant must be one word, of letters, digits, _, - and ., got {config.variant!r}: chains are found at "
            "<task>/<variant>; give variant=<word> (it is the system's name where none is given)"
        )


def _folders(config: DictConfig) -> list[Path]:
    """Those of the chain's skills, in order."""
    homes = [run / config.checkpoint for run in evaluated_runs(config)]
    found = homes if is_untrained(config.system) else chain_folders(homes[0])
    if not found:
        raise MissingFileError(f"no chain at {homes[0]}{made_by(homes[0])}")
    refuse_recovery(found[0])
    return found


def _config_of(results: Path, config: DictConfig) -> dict[str, Any]:
    """What the run's config.yaml says of where and on what it was trained."""
    if not (results / "config.yaml").is_file():
        raise MissingFileError(
            f"no config at {results / 'config.yaml'}: it names the settings and the commit"
        )
    saved = read_config(results)
    wanted = plain(config)
    same = (*SAME, *(name for name in (FURNITURE,) if name in saved))  # older runs do not say
    wrong = differences(*({name: values.get(name) for name in same} for values in (saved, wanted)))
    if wrong:
        raise CheckpointMismatchError(f"{results} is of another scale or config: {'; '.join(wrong)}")
    return {name: saved[name] for name in ("env", "versions", FURNITURE) if name in saved}


def _figures_of(results: Path, config: DictConfig) -> dict[str, dict[str, float]]:
    """The figures of its evaluation, by mode."""
    file, asked = results / "evaluation.csv", f"system={config.system} seed={config.seed}"
    needed = ["checkpoint", "seed", "mode", *FIGURES]
    table = read_table(file, needed) if file.is_file() else pd.DataFrame(columns=needed)
    rows = table[(table.checkpoint == config.checkpoint) & (table.seed == config.seed)].set_index("mode")
    if rows.empty:
        raise MissingFileError(
            f"no evaluation of {config.checkpoint} at {file}: python recipes/evaluate.py {asked}"
        )
    shares = [name for name in rows if name.startswith("subtask_")]
    columns = [*FIGURES, *shares, *(name for name in ("env_steps", "minutes") if name in rows)]
    if of_an_earlier_training(file, config):
        raise CheckpointMismatchError(
            f"{file} is of an earlier training: evaluate this one first, python recipes/evaluate.py {asked}"
        )
    kept = rows[columns].astype(object).where(rows[columns].notna(), None)
    return kept.to_dict("index")


if __name__ == "__main__":
    main()
