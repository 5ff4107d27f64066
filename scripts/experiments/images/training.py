"""The trainings of networks that make images: which there are, and their steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from networks import torch_module
from networks.e2vid import e2vid
from networks.firenet import firenet
from networks.image_loss import structural_loss
from networks.lpips import Lpips

from adv2e.errors import DataError
from experiments.images.sequences import Batches
from experiments.trainings.training import CHECKPOINT, Update, checkpoint

BUILD = {"e2vid": e2vid, "firenet": firenet}
LOSS = "L1 + 1 - SSIM"


def update_of(batches: Batches, truncate: int, device: str, lpips: Lpips | None = None) -> Update:
    """Return one step of a training: a run of windows, the gradient cut after each `truncate`."""
    torch = torch_module()

    def loss_of(image: Any, wanted: Any) -> Any:
        return structural_loss(image, wanted) if lpips is None else lpips(image, wanted).mean()

    def update(net: Any, optimiser: Any, rng: np.random.Generator) -> float:
        grids, images = (torch.from_numpy(one).to(device) for one in batches.draw(rng))
        state, total = None, 0.0
        for begin in range(0, batches.length, truncate):
            optimiser.zero_grad()
            losses = []
            for k in range(begin, min(begin + truncate, batches.length)):
                image, state = net(grids[k], state)
                losses.append(loss_of(image, images[k]))
            loss = torch.stack(losses).mean()
            loss.backward()
            optimiser.step()
            state = detached(state)
            total += float(loss.detach()) * len(losses)
        return total / batches.length

    return update


def detached(state: Any) -> Any:
    """Return a state, nested as it is, through which no gradient flows back."""
    if isinstance(state, (list, tuple)):
        return [detached(one) for one in state]
    return state.detach()


def trained(run: Path) -> Any:
    """Return the network of a training.

    Raises
    ------
    DataError
        The folder holds no checkpoint of one of these networks.
    """
    path = run / CHECKPOINT
    if not path.is_file():
        raise DataError(f"{path}: not there; give a folder that train or small made")
    state, rest = checkpoint(path)
    network = rest["settings"].get("network")
    if network not in BUILD:
        raise DataError(f"{path}: network: {network!r} is none of {', '.join(BUILD)}")
    net = BUILD[network]()
    net.load_state_dict(state["net"])
    return net.eval()
