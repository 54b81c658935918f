"""Skills drawn from the prior that a run of SPiRL has learnt, played from demonstrated states: skills.csv, skills.png.

python recipes/plot_skills.py task=table_lack subtask=0 seed=0
"""

import torch
from omegaconf import DictConfig

from tstar_rl.config.build import environment, load_demonstrations
from tstar_rl.config.load import recipe
from tstar_rl.runs.run_folder import run_path
from tstar_rl.seeds import derive_seed
from tstar_rl.spirl.agent import SkillAgent
from tstar_rl.spirl.plots import draw_skills, moments, play_skills


@recipe("plot_skills", checkpoint=str, states=int, draws=int)
def main(config: DictConfig) -> None:
    """Plays, writes and draws."""
    place = (config.task.name, "spirl", config.seed, config.subtask)
    agent = SkillAgent.load(run_path(config.runs_dir, *place) / config.checkpoint, task=config.task.name)
    agent.to(config.device)
    expert = load_demonstrations(config, config.subtask)
    rows = moments(expert, config.states, agent.settings.horizon)
    seed = derive_seed(config.seed, "evaluate", config.subtask)
    torch.manual_seed(seed)
    env = environment(config, config.subtask, config.states * config.draws, seed)
    paths = play_skills(agent, env, expert, rows)
    results = run_path(config.results_dir, *place)
    paths.to_csv(results / "skills.csv", index=False)
    print(draw_skills(paths, results / "skills.png"))


if __name__ == "__main__":
    main()
