"""Other libraries' formats: episodes with full states as robomimic-style HDF5 and as Minari data sets, and back."""

from tstar_rl.demonstrations.formats.hdf5 import of_another_world, write_hdf5
from tstar_rl.demonstrations.formats.hdf5_read import read_demonstrations, read_hdf5
from tstar_rl.demonstrations.formats.minari_write import data_set_of_another_world, write_minari
from tstar_rl.demonstrations.formats.playing import not_reproduced, record, replay, replay_demonstrations
from tstar_rl.demonstrations.formats.recording import Episode, Recording, episode_differences

__all__ = [
    "Episode",
    "Recording",
    "data_set_of_another_world",
    "episode_differences",
    "not_reproduced",
    "of_another_world",
    "read_demonstrations",
    "read_hdf5",
    "record",
    "replay",
    "replay_demonstrations",
    "write_hdf5",
    "write_minari",
]
