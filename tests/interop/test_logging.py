"""A whole session in FMPy with debug logging on: the messages that arrive, and their categories."""

import pytest
from fmpy.fmi1 import FMICallException

from coupling import Slave, declared_categories

OK, ERROR = 0, 3


@pytest.mark.parametrize("kind", ["reference_profile-filter", "plant"])
def test_a_session_with_every_category(demo, kind):
    path = demo[0] / f"unicycle-{kind}.fmu"
    log = []
    slave = Slave(path, logger=lambda *entry: log.append(entry))
    for k in range(100):
        slave.set({name: 0.1 for name in slave.names("input") if slave.variables[name].type == "Real"})
        slave.step(0.01 * k, 0.01)
        slave.get(slave.names("output"))
    # Misuse is refused with a message, and the session continues.
    with pytest.raises(FMICallException):
        slave.step(-1.0, 0.01)
    with pytest.raises(FMICallException):
        slave.fmu.setReal([10_000], [0.0])
    slave.step(1.0, 0.01)
    slave.fmu.reset()
    slave.fmu.enterInitializationMode()
    slave.fmu.exitInitializationMode()
    slave.step(0.0, 0.01)
    slave.close()

    for name, status, category, message in log:
        print(f"\n{name} [{category}] status {status}: {message}", end="")
    declared = declared_categories(path)
    assert sorted(declared) == ["logEvents", "logStatusError", "logStatusWarning"]
    # There is no warning: only a filter that follows plans gives any.
    wanted = set(declared) - {"logStatusWarning"}
    assert {category for _, _, category, _ in log} == wanted, "each category was used, no other"
    assert {name for name, *_ in log} == {log[0][0]} != {""}
    assert all(status == (ERROR if category == "logStatusError" else OK) for _, status, category, _ in log)
    events = [message for _, _, category, message in log if category == "logEvents"]
    assert events == ["instantiated", "initialized", "reset", "initialized"]
    errors = [message for _, _, category, message in log if category == "logStatusError"]
    assert len(errors) == 2
    assert errors[0].startswith("fmi2DoStep: currentCommunicationPoint is -1, must be finite and not before")
    assert errors[1].startswith("fmi2SetReal: value reference 10000 is unknown, must be 0 to ")


def test_without_logging_only_failures_arrive(demo):
    log = []
    slave = Slave(demo[0] / "unicycle-plant.fmu", logger=lambda *entry: log.append(entry))
    slave.fmu.setDebugLogging(False, [])
    log.clear()
    slave.step(0.0, 0.01)
    slave.fmu.reset()
    with pytest.raises(FMICallException):
        slave.step(0.0, 0.01)
    slave.fmu.freeInstance()
    assert [category for _, _, category, _ in log] == ["logStatusError"]
