"""The code of the pages on simulators runs, each beside a stand-in of its simulator."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import cv2
import numpy as np
import pytest

import adv2e
from adv2e import read_events
from documentation.documents import ROOT, Document

pytestmark = [
    pytest.mark.skipif(not hasattr(adv2e, "Camera"), reason="adv2e has no Camera yet"),
    pytest.mark.thorough,
]

SIZE = 346, 260


def drawn(number):
    """Return what a simulator draws: a bright bar that moves to the right, in colour (RGB)."""
    picture = np.full((SIZE[1], SIZE[0], 3), (40, 50, 60), np.uint8)
    left = 20 + 4 * number
    picture[:, left : left + 40] = (200, 180, 160)
    return picture


def code_of(page):
    """Return the blocks of Python of a page of tutorials."""
    document = Document.read(ROOT / "docs" / "tutorials" / page)
    return [block.text for block in document.blocks if block.language == "python"]


def run(text, names):
    exec(compile(text, "page", "exec"), names)
    return names


def check_that_the_bar_moves(events):
    """Fail unless ON events lie at the bar's right edge as it moves, OFF ones at its left."""
    assert len(events) > 1000
    assert (np.diff(events["t"]) >= 0).all()
    columns = {
        (half, p): np.median(part["x"][part["p"] == p])
        for half, part in enumerate(np.array_split(events, 2))
        for p in (0, 1)
    }
    assert columns[0, 1] < columns[1, 1] and columns[0, 0] < columns[1, 0]
    assert columns[1, 1] - columns[1, 0] == pytest.approx(40, abs=25)


class World:
    """A stand-in of CARLA's world, client, actors and blueprints."""

    def __init__(self, *_):
        self.steps, self.listener, self.step_s = 0, None, 0.0
        self.left = []
        self.settings = SimpleNamespace(synchronous_mode=False, fixed_delta_seconds=None)

    def apply_settings(self, settings):
        self.step_s = settings.fixed_delta_seconds or 0.0

    def get_settings(self):
        return self.settings

    def set_timeout(self, seconds):
        assert seconds > 0

    def spawn_actor(self, blueprint, transform, attach_to=None):
        assert (attach_to is None) == (blueprint.kind != "sensor.camera.rgb")
        return SimpleNamespace(
            set_autopilot=lambda on: None, listen=self.listen,
            destroy=lambda: self.left.append(blueprint.kind),
        )  # fmt: skip

    def listen(self, callback):
        self.listener = callback

    def get_world(self):
        return self

    get_map = get_blueprint_library = get_world

    def get_spawn_points(self):
        return ["a spot"]

    def filter(self, pattern):
        return [self.find(pattern)]

    def find(self, kind):
        set_to = {}
        return SimpleNamespace(kind=kind, set_attribute=set_to.__setitem__)

    def tick(self):
        """Draw a frame, stored as blue, green, red, alpha, at the time of this step."""
        assert self.settings.synchronous_mode
        self.steps += 1
        picture = cv2.cvtColor(drawn(self.steps % 70), cv2.COLOR_RGB2BGRA)
        self.listener(
            SimpleNamespace(
                raw_data=memoryview(picture.tobytes()), width=SIZE[0], height=SIZE[1],
                timestamp=100.0 + self.steps * self.step_s,
            )
        )  # fmt: skip


def test_carla(tmp_path, monkeypatch):
    world = World()
    module = ModuleType("carla")
    module.Client = lambda host, port: world
    module.Transform = module.Location = lambda *_, **__: None
    monkeypatch.setitem(sys.modules, "carla", module)
    monkeypatch.chdir(tmp_path)
    (text,) = code_of("carla.md")
    run(text.replace("range(200)", "range(60)"), {})
    events = read_events("carla.h5").events
    check_that_the_bar_moves(events)
    assert events["t"][0] >= 100.0e6
    assert world.left == ["sensor.camera.rgb", "vehicle.*"]
    assert world.settings.synchronous_mode is False


class Blender:
    """A stand-in of the modules of Blender that the page uses."""

    def __init__(self):
        render = SimpleNamespace(fps=240, fps_base=1.0, image_settings=SimpleNamespace())
        self.scene = SimpleNamespace(
            render=render, view_settings=SimpleNamespace(view_transform="AgX"),
            frame_start=1, frame_end=60, frame_set=self.at,
        )  # fmt: skip
        self.frame = 1
        self.context = SimpleNamespace(scene=self.scene)
        self.ops = SimpleNamespace(render=SimpleNamespace(render=self.render))

    def at(self, frame):
        self.frame = frame

    def render(self, write_still=False, animation=False):
        assert self.scene.view_settings.view_transform == "Standard"
        assert self.scene.render.image_settings.file_format == "PNG"
        if write_still:
            self.write(self.scene.render.filepath, self.frame)
        for frame in range(1, 61) if animation else ():
            self.write(f"{self.scene.render.filepath}{frame:04d}.png", frame)

    def write(self, path, frame):
        Path(path).parent.mkdir(exist_ok=True)
        cv2.imwrite(path, cv2.cvtColor(drawn(frame), cv2.COLOR_RGB2BGR))


def test_blender(adv2e, tmp_path, monkeypatch):
    module = Blender()
    monkeypatch.setitem(sys.modules, "bpy", module)
    monkeypatch.chdir(tmp_path)
    rendered, pushed = code_of("blender.md")
    run(rendered, {})
    assert len([*Path("rendered").iterdir()]) == 60
    convert = ("convert", "rendered/", "--fps", "240", "-c", "davis346", "--seed", "1")
    assert adv2e(*convert, "-o", "blender.h5").status == 0
    run(pushed, {})
    events = read_events("pushed.h5").events
    check_that_the_bar_moves(events)
    assert (events == read_events("blender.h5").events).all()  # both ways give the same


class Pictures:
    """A stand-in of a tensor on a device."""

    def __init__(self, pictures):
        self._pictures = pictures

    def __len__(self):
        return len(self._pictures)

    def cpu(self):
        return SimpleNamespace(numpy=lambda: self._pictures)


def test_isaac(capsys):
    steps = [0]

    def draw():
        return Pictures(np.stack([drawn(steps[0] % 70), drawn(5)]))

    camera = SimpleNamespace(data=SimpleNamespace(output={"rgb": draw()}))

    def step():
        steps[0] += 1
        camera.data.output["rgb"] = draw()

    simulation = SimpleNamespace(step=step, get_physics_dt=lambda: 1 / 200)

    class Scene(dict):
        def update(self, dt):
            assert dt > 0

    the_class, loop = code_of("isaac.md")
    names = run(the_class, {"scene": Scene(camera=camera), "simulation": simulation})
    run(loop.replace("range(100)", "range(20)"), names)
    counts = [list(map(int, line.split())) for line in capsys.readouterr().out.splitlines()]
    moving = [count for number, count in counts if number == 0]
    resting = [count for number, count in counts if number == 1]
    assert len(moving) == len(resting) == 20
    assert sum(moving) > 10 * sum(resting)
    assert len(names["sensors"].sensors[0].push(drawn(1), 0.0)) == 0  # begins anew
