"""The recipes of the library by what they do. A recipe of a user's own is in none of these."""

__all__ = [
    "FINE_TUNING",
    "IN_ORDER",
    "LAUNCHING",
    "LEARN_FROM_KEPT",
    "LEARN_FROM_PATHS",
    "OF_CHAINS",
    "ONE_POLICY",
    "OURS",
    "STEPS",
    "WHOLE",
]

ONE_POLICY = ("bc", "ppo", "gail", "gail_ppo", "spirl")
"""Recipes that train one policy, of a subtask or of the whole task."""
WHOLE = ("ablate", "assemble", "baselines", "experiment", "gpu_run")
"""Recipes that start others for the whole task."""
LAUNCHING = ("ablate", "assemble", "baselines")
"""Those of them that can start them on a cluster."""
OF_CHAINS = ("anatomy", "hand_over", "hand_over_gap", "moved_parts", "ship", "terminal_states", "ways_home")
"""Recipes that read what a chain's training has left."""
FINE_TUNING = (
    "feasibility", "hand_over_value", "in_order", "in_order_cloned", "policy_sequencing", "proximity", "scar_like",
    "tstar",
)  # fmt: skip
"""Our recipes with the turns of a chain. A recipe of a user's own may read anything."""
STEPS = (
    *ONE_POLICY,
    *FINE_TUNING,
    *OF_CHAINS,
    *(
        "evaluate",
        "evaluate_expert",
        "evaluate_shelf",
        "exchanged",
        "export",
        "parity",
        "plot",
        "plot_latents",
    ),
    *("floored", "make_demonstrations", "recover", "refitted", "report", "watch"),
)
"""Our recipes that start no other."""
OURS = (*STEPS, *WHOLE, "bench", "bench_growth")
"""All recipes of the library: whose own keys `ranges` and `unread` know."""
IN_ORDER = ("in_order", "in_order_cloned")
"""Recipes that clone a skill's demonstrations when its turn comes."""
LEARN_FROM_KEPT = ("feasibility", "hand_over_value", "scar_like", "tstar")
"""Recipes whose signal learns from the rows that chain.kept_states keeps."""
LEARN_FROM_PATHS = ("proximity", "refitted")
"""Recipes that read the states on the way, of which chain.path_steps keeps the last."""
