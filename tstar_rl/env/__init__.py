"""The furniture tasks as TorchRL environments. The one room that imports the world (`tstar_envs`)."""
