"""Skill chaining: the skill, the chain of skills, and the turns in which skills are fine-tuned."""
