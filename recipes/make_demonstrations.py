"""Scripted demonstrations, plain and noise-injected, of one subtask, of all, or of the whole task.

python recipes/make_demonstrations.py                 # every subtask, both kinds
python recipes/make_demonstrations.py subtask=0 kinds=[noisy]
"""

from functools import partial

from omegaconf import DictConfig
from tqdm import tqdm

from tstar_rl.config.build import environment
from tstar_rl.config.demonstrations import check_made, demonstrated, demonstrations_path, demonstrations_seed
from tstar_rl.config.load import recipe
from tstar_rl.demonstrations.collect import collect
from tstar_rl.demonstrations.file_check import KINDS
from tstar_rl.seeds import derive_seed


@recipe("make_demonstrations", kinds=tuple[str, ...], whole=bool)
def main(config: DictConfig) -> None:
    """Writes the files that are not there yet; one that is there must be what would be written."""
    number = config.demonstrations.num_envs
    for subtask in demonstrated(config):
        for kind in config.kinds:
            path = demonstrations_path(config, subtask, kind)
            if path.is_file() and config.resume:
                check_made(config, subtask, kind)
                continue
            part = config.task.subtasks if subtask is None else subtask
            own = demonstrations_seed(config)
            seed = derive_seed(own, "demonstrate", part, KINDS.index(kind))
            with tqdm(desc=path.stem, unit=" steps", disable=not config.progress_bar) as bar:
                found = collect(
                    partial(environment, config, subtask, number, snapshots=True),
                    config.demonstrations.episodes,
                    kind,
                    config.demonstrations.noise,
                    seed,
                    partial(bar.update, number),
                )
                bar.set_postfix(episodes=len(found))
            found.save(path)
            print(path)


if __name__ == "__main__":
    main()
