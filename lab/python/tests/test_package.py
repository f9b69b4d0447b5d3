"""The package has all documented names, and documents all its names."""

import importlib.metadata
import inspect

import pytest

import headrace
from headrace import sampling


def public():
    for module in (headrace, sampling):
        for name in module.__all__:
            thing = getattr(module, name)
            if name != "__version__":
                yield f"{module.__name__}.{name}", thing
            if inspect.isclass(thing):
                for member, value in vars(thing).items():
                    if not member.startswith("_") and (callable(value) or inspect.isdatadescriptor(value)):
                        yield f"{name}.{member}", value


@pytest.mark.parametrize("name, thing", list(public()))
def test_public_names_are_documented(name, thing):
    assert len(inspect.getdoc(thing) or "") > 8, name


def test_all_names_of_the_compiled_module_are_public():
    from headrace import _headrace

    names = {name for name in vars(_headrace) if not name.startswith("_")}
    assert names - {"plan_json"} <= set(headrace.__all__) | set(sampling.__all__)
    assert headrace.__version__ == importlib.metadata.version("headrace")


def test_repr_describes_values(golden):
    log = headrace.Log(golden / "steel.mcap")
    assert "steel.mcap" in repr(log) and "1 files" in repr(log)
    assert repr(log.sources()[0]).startswith("Source(id=")
    assert repr(next(log.messages())).startswith("<Message raw")
    assert repr(headrace.Profile.circle(1.0)) == "<Profile, perimeter 6.283 m>"
    turn = sampling.Turn(0.015707963267948967, 8.0)
    assert eval(repr(turn), {"Turn": sampling.Turn}) == turn != sampling.Turn(0.015707963267948967, 9.0)


def test_base_exception_catches_each_exception():
    for error in (headrace.LogError, headrace.ConfigError, headrace.ReplayError, headrace.SamplingError):
        assert issubclass(error, headrace.HeadraceError)
        told = error("why", "file", "byte 3")
        assert (str(told), told.file, told.place) == ("why", "file", "byte 3")
