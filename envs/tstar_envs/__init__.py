"""The world: furniture, robot, physics and the batched assembly task. No learning, no TorchRL."""
