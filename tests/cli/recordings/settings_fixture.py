"""Settings as a service publishes them, in a recording."""

from collections.abc import Iterable, Mapping
from typing import Any

from common.config import flatten
from t2 import codec, keys
from t2.codec import Sample
from t2.messages import Message, Motion, Setting, Settings
from tests.recorder.samples import bare


def settings_of(config: Any, boot: int = 0, **others: Any) -> Settings:
    """Return the message of a service with this configuration; None removes a setting."""
    return message(
        dict(flatten(config)) | {k.replace("__", "."): v for k, v in others.items()}, boot
    )


def message(values: Mapping[str, Any], boot: int = 0) -> Settings:
    """Return a message with these values by path, without those that are None."""
    given = {
        path: Setting(value=value, origin="robot.toml")
        for path, value in values.items()
        if value is not None
    }
    return Settings(settings=given, boot=boot)


def as_sample(
    message: Message, wall_ns: int, service: str = "safety", robot: str = "001"
) -> Sample:
    """Return the sample of a message on a service's key, received at this time."""
    found = bare("", codec.encode(message), codec.encoding(type(message)))
    key = keys.SETTINGS.on(robot, service=service)
    return Sample(
        key=key, payload=found.payload, encoding=found.encoding, deleted=False, raw=None,
        received_ns=wall_ns, wall_ns=wall_ns,
    )  # fmt: skip


def boots(samples: Iterable[Sample]) -> list[int]:
    """Return the runs of safety in samples, by the boot of their motions."""
    decoded = (
        codec.decode(one.payload, Motion) for one in samples if one.key.endswith("@cmd/motion")
    )
    return list(dict.fromkeys(each.boot for each in decoded))
