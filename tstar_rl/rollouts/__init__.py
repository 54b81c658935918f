"""Episodes: the collectors, where episodes begin, the sets of states they leave, and whole episodes for evaluation."""
