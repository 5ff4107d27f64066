"""Configuration: YAML files and ``--set`` values to frozen dataclasses, strictly."""

from adv2e.config.model import Config

__all__ = ["Config"]
