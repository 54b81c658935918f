"""Plays latents drawn from the prior of a SPiRL run, from demonstrated states: latents.csv and latents.png.

python recipes/plot_latents.py task=table_lack subtask=0 seed=0
"""

import torch
from omegaconf import DictConfig

from tstar_rl.analysis import save_figure
from tstar_rl.config.build import environment, load_demonstrations
from tstar_rl.config.load import recipe
from tstar_rl.config.worlds import check_world
from tstar_rl.runs.csv_tables import write_table
from tstar_rl.runs.run_folder import run_path
from tstar_rl.seeds import evaluation_seed
from tstar_rl.spirl import SpirlAgent
from tstar_rl.spirl.figures import evenly_spread_rows, latents_figure, play_latents


@recipe("plot_latents", checkpoint=str, states=int, draws=int)
def main(config: DictConfig) -> None:
    """Plays the latents, writes the paths of the grip and draws them."""
    place = (config.task.name, config.system, config.seed, config.subtask)
    results = run_path(config.results_dir, *place)
    folder = run_path(config.runs_dir, *place) / config.checkpoint
    check_world(config, folder, results)
    agent = SpirlAgent.load(folder, task=config.task.name)
    agent.to(config.device)
    expert = load_demonstrations(config, config.subtask)
    rows = evenly_spread_rows(expert, config.states, agent.settings.horizon)
    seed = evaluation_seed(config.seed, "latents", config.subtask)
    torch.manual_seed(seed)
    env = environment(config, config.subtask, config.states * config.draws, seed)
    paths = play_latents(agent, env, expert, rows)
    write_table(results / "latents.csv", paths)
    print(save_figure(latents_figure(paths), results / "latents.png", dpi=100))


if __name__ == "__main__":
    main()
