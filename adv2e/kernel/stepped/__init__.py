"""The stepping solver: a strip of pixels over one step of time after another."""
