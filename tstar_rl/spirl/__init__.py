"""SPiRL (Pertsch et al., 2020): latent actions and their prior from demonstrations, and the policy over them."""
