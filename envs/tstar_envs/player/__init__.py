"""Recorded episodes as one HTML file that plays in any browser, from disk, without a network.

from tstar_envs.player import Episode, write_player

write_player("episodes.html", world.drawn_model, [Episode("first", positions, subtask, phase, reward, True)])
"""

from tstar_envs.player.episode import Episode
from tstar_envs.player.page import write_player

__all__ = ["Episode", "write_player"]
