"""What the page shows of chains with recovery, and of no others."""

from published_runs import THEIRS, write

from tstar_rl.analysis.page import results_page


def test_the_page_says_how_long_an_episode_is_and_how_often_the_arm_goes_home(published):
    for seed, homings in ((3, 2.0), (4, 1.5)):
        write(
            published, "odd", "recover", seed, 0.5, columns={"homings": homings, "episode_length": 400 + seed}
        )
    odd, plain = results_page(published, THEIRS, "").split("\n## Odd chains\n")[1].split("\n## Plain: chains")
    header, row = (
        next(line for line in odd.splitlines() if line.startswith(begin)) for begin in ("| arm |", "| rec")
    )
    assert header.endswith(
        "| environment steps, without trials | steps of an episode (mean) | ways home in it (mean) |"
    )
    assert row.endswith("| 0.50M | 404 | 1.75 |")
    assert "ways home" not in plain
