"""Processes that convert: killed, called again, beside each other, or ended by themselves."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import trees_of_batch as trees
from trees_of_batch import QUICK, clip, in_this_process, made_in

from adv2e.batches import processes
from adv2e.batches.processes import run
from adv2e.batches.run import Batch, Settings
from adv2e.batches.work import Job
from adv2e.config import load_config, to_dict
from adv2e.config.user_effects import load_effects

ENDING = """
import os, signal
from dataclasses import dataclass
from adv2e.effects.hooks import Hooks
from adv2e.parameters import Section, parameter
from adv2e.process.signals import Terminated

@dataclass(frozen=True, kw_only=True)
class Parameters(Section):
    signal: int = parameter(0, unit="-", meaning="signal that ends the process")

class Ending(Hooks):
    '''Ends the process.'''
    name = "ending"
    stage = "frames"
    Parameters = Parameters
    def light(self, frames):
        number = self.parameters.signal
        if number < 0:  # as a signal comes while files come into place
            raise KeyboardInterrupt if number == -signal.SIGINT else Terminated(-number)
        if number:
            os.kill(os.getpid(), number)
        yield from frames
"""


def job(tmp_path, name, *sets, effects=()):
    source = clip(tmp_path / f"{name}.avi")
    loaded = [one for file in effects for one in load_effects(file)]
    config = load_config((), ("sampling.L=1", "pixel.low_pass=null", *sets), 1, loaded)
    output = str(tmp_path / f"{name}.h5")
    return Job(name, str(source), output, to_dict(config), {}, tuple(map(str, effects)))


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
@pytest.mark.parametrize(
    "number",
    [signal.SIGSEGV, -signal.SIGINT],
)
@pytest.mark.thorough
def test_a_process_that_dies_fails_its_sequence_alone(tmp_path, number):
    effect = tmp_path / "ending.py"
    effect.write_text(ENDING)
    jobs = [
        job(tmp_path, "a", effects=[effect]),
        job(tmp_path, "b", f"user.ending.signal={int(number)}", effects=[effect]),
        job(tmp_path, "c", effects=[effect]),
    ]
    found = {one.name: result for one, result in run(jobs, 1)}
    assert "error" not in found["a"]
    assert "b.avi: the process that converted it was ended from outside" in found["b"]["error"]
    assert "error" not in found["c"]
    assert (tmp_path / "c.h5").exists()
    assert not (tmp_path / "b.h5").exists()


@pytest.mark.thorough
def test_processes_stay_alive_over_many(tmp_path, monkeypatch):
    made = []
    whole = processes.start
    monkeypatch.setattr(processes, "start", lambda: made.append(1) or whole())
    jobs = [job(tmp_path, f"s{k}") for k in range(4)]
    found = {one.name: result for one, result in run(jobs, 1)}
    assert sorted(found) == ["s0", "s1", "s2", "s3"]
    assert all(result["events"] > 0 for result in found.values())
    assert len(made) == 1


@pytest.mark.parametrize("at_prompt", [False, True])
@pytest.mark.quick_cases(1)
def test_no_code_of_the_current_folder_runs(tmp_path, monkeypatch, at_prompt):
    """Neither as a module of Python's own or of ours, nor as one that Python looks for itself."""
    one = job(tmp_path, "a")
    names = "signal struct threading pickle subprocess numpy yaml adv2e sitecustomize usercustomize"
    for name in names.split():
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'RAN')!r}, 'w')")
    monkeypatch.chdir(tmp_path)
    if at_prompt:  # or with `python -c`
        monkeypatch.setattr(sys, "path", ["", ".", *sys.path])
    ((_, found),) = run([one], 1)
    assert "error" not in found
    assert not (tmp_path / "RAN").exists()


@pytest.mark.thorough
def test_a_script_that_calls_for_a_batch_runs_once(tmp_path):
    clip(tmp_path / "from" / "a.avi")
    script = tmp_path / "script.py"
    script.write_text(
        "from pathlib import Path\n"
        "from adv2e.batches.run import Batch, Settings\n"
        "print('runs', flush=True)\n"
        f"settings = Settings((), {tuple(QUICK[1::2])!r}, (), None, '.h5', {{'format': 'h5'}})\n"
        "print(Batch(Path('from'), Path('to'), settings).run(jobs=1).made)\n"
    )
    told = [sys.executable, str(script)]
    done = subprocess.run(told, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("runs\n1\n", "")


LOUD = """
import os
from adv2e.effects.hooks import Hooks

class Loud(Hooks):
    'Prints, as C code does.'
    name = "loud"
    stage = "frames"
    def light(self, frames):
        print("text", flush=True)
        os.write(1, b"text")
        yield from frames
"""


@pytest.mark.thorough
def test_what_is_printed_in_a_process_is_no_answer(tmp_path, capfd):
    effect = tmp_path / "loud.py"
    effect.write_text(LOUD)
    ((_, found),) = run([job(tmp_path, "a", effects=[effect])], 1)
    assert found["events"] > 0
    assert capfd.readouterr() == ("", "text\n")


def test_a_source_that_is_gone_is_an_error_of_its_own(tmp_path):
    gone = job(tmp_path, "a")
    Path(gone.source).unlink()
    ((_, found),) = run([gone], 1)
    assert "a.avi" in found["error"]
    assert "\n" not in found["error"]


def begun(*args):
    signal.signal(signal.SIGINT, signal.default_int_handler)  # shells ignore it in the background
    return subprocess.Popen(
        trees.command(*args), stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    )


def wait_for(condition, process, seconds=60.0):
    until = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < until
        time.sleep(0.01)


@pytest.fixture(scope="module")
def longer(tmp_path_factory):
    root = tmp_path_factory.mktemp("longer")
    for k in range(4):
        clip(root / f"{k}.avi", count=25, start=k, size=(240, 180))
    return root


@pytest.fixture(scope="module")
def of_longer(longer, tmp_path_factory):
    """What one batch makes, in one go and one process."""
    dest = tmp_path_factory.mktemp("of_longer")
    settings = Settings((), tuple(QUICK[1::2]), (), None, ".h5", {"format": "h5"})
    Batch(longer, dest, settings).run(engine=in_this_process)
    return made_in(dest)


def alive(group):
    try:
        os.killpg(group, 0)
    except OSError:
        return False
    return True


@pytest.mark.thorough
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_ended_and_called_again_the_bytes_are_the_same(batch, longer, of_longer, tmp_path, number):
    dest = tmp_path / "to"
    process = begun(longer, dest, *QUICK, "--jobs", 2)
    # events are being written
    wait_for(lambda: any(p.stat().st_size > 100_000 for p in dest.rglob("new*.h5")), process)
    process.send_signal(number)
    process.communicate(timeout=30)
    expected = {signal.SIGKILL: -9, signal.SIGINT: 130, signal.SIGTERM: 143}
    assert process.returncode == expected[number]
    # the processes that convert end, too
    until = time.monotonic() + 20
    while alive(process.pid) and time.monotonic() < until:
        time.sleep(0.05)
    assert not alive(process.pid)
    assert set(made_in(dest)) <= set(of_longer)
    done = batch(longer, dest)
    assert done.status == 0, done.err
    assert made_in(dest) == of_longer
    assert not [*dest.rglob(".adv2e*")]


@pytest.mark.thorough
def test_a_second_batch_on_the_same_folder_is_refused(batch, longer, of_longer, tmp_path):
    dest = tmp_path / "to"
    process = begun(longer, dest, *QUICK, "--jobs", 2)
    wait_for(lambda: any(dest.rglob("*.part")), process)
    second = batch(longer, dest)
    assert second.status == 1
    assert "manifest.jsonl: another batch writes here" in second.err
    assert process.wait(120) == 0
    process.stdout.close()
    process.stderr.close()
    assert made_in(dest) == of_longer
