"""A small experiment as its file in configs/experiment would have it."""

SMALL = {
    "name": "small",
    "page": "docs/method.md",
    "scale": "quick",
    "tasks": ["table_lack"],
    "seeds": [7, 8],
    "arms": [
        {"name": "no_finetuning", "recipe": "no_finetuning"},
        {"name": "paid", "recipe": "policy_sequencing", "bonus_of": "tstar"},
        {"name": "tstar", "recipe": "tstar", "overrides": ["d_omega.steps=3"]},
        {"name": "gaussian", "recipe": "policy_sequencing", "seeds": [8]},
    ],
}
