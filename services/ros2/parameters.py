"""The parameters of the gateway's node, and its answers to ROS's six parameter services. Pure.

They are the settings of ``[ros2]`` and ``[vehicle]``, and the limits that safety permits now, all
read-only. Without these services ``ros2 param list`` waits 7 s for the node.
"""

from collections.abc import Callable, Iterator, Mapping

from services.ros2.cdr import Value
from services.ros2.config import Ros2Config
from t2.messages import Limits

Scalar = bool | int | float | str
Parameters = Mapping[str, Scalar]
Respond = Callable[..., Value]  # the parameters, and the fields of a request

KINDS = (None, bool, int, float, str)  # by number of rcl_interfaces/ParameterType: 0 is "not set"
NOT_SET: Value = (0, False, 0, 0.0, "", (), (), (), (), ())
READ_ONLY: Value = False, "Read-only: it is a setting of the robot's files, or a limit of safety."


def parameters(config: Ros2Config, limits: Limits | None) -> Parameters:
    """Return all parameters by name; without limits while safety is silent."""
    sections = {"ros2": config.ros2, "vehicle": config.vehicle, "limits": limits}
    return dict(_fields(sections))


def _fields(sections: Mapping[str, object]) -> Iterator[tuple[str, Scalar]]:
    for name, section in sections.items():
        for field in getattr(section, "__struct_fields__", ()):
            if type(value := getattr(section, field)) in KINDS:
                yield f"{name}.{field}", value


def parameter_value(value: Scalar | None) -> Value:
    """Return a rcl_interfaces/ParameterValue: its fields are in the order of the kinds."""
    kind = _kind(value)
    return (kind, *NOT_SET[1:kind], value, *NOT_SET[kind + 1 :]) if kind else NOT_SET


def _kind(value: Scalar | None) -> int:
    return 0 if value is None else KINDS.index(type(value))


def _get(known: Parameters, names: tuple[str, ...] = ()) -> Value:
    return (tuple([parameter_value(known.get(name)) for name in names]),)


def _get_types(known: Parameters, names: tuple[str, ...] = ()) -> Value:
    return (tuple([_kind(known.get(name)) for name in names]),)


def _describe(known: Parameters, names: tuple[str, ...] = ()) -> Value:
    return (tuple([(n, _kind(known.get(n)), "", "", True, False, (), ()) for n in names]),)


def _list(known: Parameters, prefixes: tuple[str, ...] = (), depth: int = 0) -> Value:
    names = tuple([name for name in known if _is_below(name, prefixes, depth)])
    return ((names, tuple(sorted({name.rpartition(".")[0] for name in names}))),)


def _is_below(name: str, prefixes: tuple[str, ...], depth: int) -> bool:
    """Return whether a name is a prefix or below it, by so many levels at most; 0: any."""
    below = [name[len(each) + 1 :] for each in prefixes if f"{name}.".startswith(f"{each}.")]
    return any(not depth or path.count(".") < depth for path in (below if prefixes else [name]))


def _set(_: Parameters, changes: tuple[Value, ...] = ()) -> Value:
    return (tuple([READ_ONLY for _ in changes]),)


def _set_atomically(_: Parameters, __: tuple[Value, ...] = ()) -> Value:
    return (READ_ONLY,)


# By name below the node: the type, and the function that returns the response.
SERVICES: Mapping[str, tuple[str, Respond]] = {
    "describe_parameters": ("rcl_interfaces/srv/DescribeParameters", _describe),
    "get_parameter_types": ("rcl_interfaces/srv/GetParameterTypes", _get_types),
    "get_parameters": ("rcl_interfaces/srv/GetParameters", _get),
    "list_parameters": ("rcl_interfaces/srv/ListParameters", _list),
    "set_parameters": ("rcl_interfaces/srv/SetParameters", _set),
    "set_parameters_atomically": ("rcl_interfaces/srv/SetParametersAtomically", _set_atomically),
}
