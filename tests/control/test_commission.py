"""The walk through a new PLC: nothing without asking, everything through the guard, and the pulled plug."""

from __future__ import annotations

import pytest

from igrow.edge.commission import Commissioning
from igrow.edge.configuration import load_configuration
from igrow.edge.registers.model import Function
from igrow.edge.virtual_plc.pace import Lockstep, Realtime
from tests.control.daemon_bench import Plant, free_port, write_files


class Script:
    """A person who answers yes, apart from questions with one of these words."""

    def __init__(self, *no: str) -> None:
        self._no = no
        self.lines: list[str] = []
        self.questions: list[str] = []

    def tell(self, line: str) -> None:
        self.lines.append(line)

    def ask(self, question: str) -> bool:
        self.questions.append(question)
        return not any(word in question for word in self._no)


class Watched(Plant):
    """A plant that keeps what was written to its setpoints."""

    async def up(self) -> None:
        await super().up()
        write = self.plc.write
        self.written: list[tuple[int, list[int]]] = []

        def watched(function, address, values):
            self.written.append((address, list(values)))
            write(function, address, values)

        self.plc.write = watched


async def walk(tmp_path, person, *, pace=None, only_read=False, prepare=lambda plant: None, edit=lambda text: text):
    port = free_port()
    path = write_files(tmp_path, port)
    register_map = tmp_path / "map.yaml"
    register_map.write_text(edit(register_map.read_text()))
    # Fifteen minutes of plant time pass in a second or so.
    plant = Watched(tmp_path, port, pace=pace or Realtime(900.0))
    await plant.up()
    prepare(plant)
    commissioning = Commissioning(
        load_configuration(path), person, fallback_after=2.0, only_read=only_read, settle=0.01
    )
    passed = await commissioning.run()
    await plant.down()
    return passed, plant


async def test_a_plc_that_does_everything_right_passes(tmp_path):
    person = Script()
    passed, _ = await walk(tmp_path, person)
    assert passed, person.lines
    assert any("fell back after" in line for line in person.lines)
    assert any(line.strip() == "its own co2_setpoint = 400 ppm" for line in person.lines)


IDENTITY = "device_id: 1, identity: {function: input, address: 20, content: [47, 11]}}"


async def test_a_plc_that_says_who_it_is_is_asked_first(tmp_path):
    person = Script()
    passed, _ = await walk(tmp_path, person, only_read=True, edit=lambda text: text.replace("device_id: 1}", IDENTITY))
    assert passed, person.lines
    assert person.lines[0] == "  unit plc shows its identity: 47, 11 in input 20"


async def test_another_plc_at_the_address_is_one_line_and_nothing_is_written(tmp_path):
    def another(plant):
        table = plant.plc.memory.tables[Function.INPUT]
        table.put(20, [47, 12])

    person = Script()
    passed, plant = await walk(
        tmp_path, person, prepare=another, edit=lambda text: text.replace("device_id: 1}", IDENTITY)
    )
    assert not passed
    (line,) = person.lines
    assert "unit plc shows 47, 12 in input 20, but its `identity` in the map is 47, 11 in input 20" in line
    assert plant.written == []


async def test_a_person_is_asked_for_the_value_that_the_register_will_show(tmp_path):
    def in_tenths(text):
        return text.replace(
            "address: 0, type: float32, unit: degC, writable",
            "address: 0, type: int16, scale: 0.1, unit: degC, writable",
        )

    person = Script()
    passed, _ = await walk(tmp_path, person, edit=in_tenths)
    assert passed, person.lines
    assert "Does the PLC show heating_setpoint = 17.4?" in person.questions


@pytest.mark.parametrize("has_bit", [True, False])
async def test_safe_setpoints_of_the_plc_that_are_not_the_sites_are_told(tmp_path, has_bit):
    person = Script()
    passed, _ = await walk(
        tmp_path, person, edit=lambda text: text if has_bit else text.replace("plc_fallback", "rain")
    )
    assert "  its own heating_setpoint = 17 degC; `safe` in the site's file is 18: best the same" in person.lines
    # The bit tells a fallback; without it nothing but these values does.
    assert passed == has_bit
    assert has_bit or any("heating_setpoint differ from it" in line for line in person.lines)


async def test_a_person_compares_a_screenful_at_a_time_and_never_what_moves(tmp_path):
    person = Script()
    await walk(tmp_path, person, only_read=True)
    shown = [line for line in person.lines if " = " in line]
    assert len(person.questions) == -(-len(shown) // 8)
    assert not any(name in line for line in shown for name in ("heartbeat", "plc_clock"))


async def test_each_value_is_read_when_it_is_shown(tmp_path, monkeypatch):
    monkeypatch.setattr("igrow.edge.commission.SCREENFUL", 1)

    class Slow(Script):
        def ask(self, question):
            # Somebody changes a value at the PLC while the person still compares the values before it.
            plants[0].plc.set_by_hand("heating_setpoint", 21.0)
            return super().ask(question)

    person = Slow()

    plants: list[Plant] = []

    def prepare(made):
        plants.append(made)
        made.plc.set_by_hand("heating_setpoint", 18.0)

    await walk(tmp_path, person, only_read=True, prepare=prepare)
    assert "  heating_setpoint = 21 degC" in person.lines


async def test_nothing_is_written_by_a_walk_that_only_reads(tmp_path):
    passed, plant = await walk(tmp_path, Script(), only_read=True)
    assert passed
    assert plant.written == []


async def test_nothing_is_written_to_what_the_person_keeps_back(tmp_path):
    person = Script("May heating_setpoint", "Now the heartbeat")
    passed, plant = await walk(tmp_path, person)
    assert not passed
    assert {address for address, _ in plant.written} == {2}
    assert "NOT PASSED  heating_setpoint was not tried" in person.lines
    assert "NOT PASSED  the fallback was not tried" in person.lines


async def test_a_value_that_the_plc_shows_otherwise_is_a_failure(tmp_path):
    person = Script("all of them", "air_temperature =")
    passed, _ = await walk(tmp_path, person, only_read=True)
    assert not passed
    assert any("but the PLC shows something else" in line for line in person.lines)


async def test_a_value_far_off_points_to_scale_and_byte_order(tmp_path):
    person = Script()
    passed, _ = await walk(
        tmp_path, person, only_read=True, prepare=lambda plant: plant.plc.set_by_hand("air_temperature", 4e8)
    )
    assert not passed
    assert any("look at scale and byte order" in line for line in person.lines)


async def test_a_plc_that_never_falls_back_does_not_pass(tmp_path, monkeypatch):
    monkeypatch.setattr("igrow.edge.commission.PATIENCE", 0.1)
    person = Script()
    # In lock-step no plant time passes without a heartbeat, so this PLC never notices that it has stopped.
    passed, _ = await walk(tmp_path, person, pace=Lockstep(1.0))
    assert not passed
    assert "NOT PASSED  the PLC did not fall back when the heartbeat stopped" in person.lines


async def test_a_dead_line_ends_the_walk_with_its_reason(tmp_path, monkeypatch):
    monkeypatch.setattr("igrow.edge.commission.LINE_SECONDS", 0.5)
    person = Script()
    configuration = load_configuration(write_files(tmp_path, free_port()))
    assert not await Commissioning(configuration, person).run()
    assert "no point can be read" in person.lines[0]
    assert person.questions == []


@pytest.mark.parametrize("answer", ["y", "n"])
def test_a_person_is_asked_until_the_answer_is_clear(monkeypatch, answer):
    from igrow.edge.commission import Console

    answers = iter(["", "perhaps", answer])
    monkeypatch.setattr("builtins.input", lambda prompt: next(answers))
    assert Console().ask("well?") is (answer == "y")
