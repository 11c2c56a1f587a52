"""``t2 foxglove``: the bus, live, to Foxglove or Lichtblick over a web socket."""

import argparse
from typing import TYPE_CHECKING

from cli.inspect.addressing import EVERYTHING, expression
from cli.inspect.shell import add_end, add_options, quietly, seated
from common.cli_args import sources
from common.config import load
from common.errors import LinkError, RobotError
from services.recorder.config import RecorderConfig
from services.recorder.mcap_codec import Channel, Entry, Translator

if TYPE_CHECKING:
    from foxglove import Channel as Shown
    from foxglove import Context

PORT = 8765  # where the viewers look first


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("--host", default="127.0.0.1", help="0.0.0.0 shows it to the whole network")
    parser.add_argument("--port", type=int, default=PORT, help=f"{PORT} unless told otherwise")
    add_end(parser)
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Show until it ends; raise ``LinkError`` when the port cannot be had."""
    try:
        import foxglove
    except ModuleNotFoundError:
        raise RobotError(
            "it needs foxglove-sdk: install the extra `foxglove` (pip install -e '.[foxglove]')"
        ) from None
    translator = Translator(load(RecorderConfig, sources(options)).config.vehicle)
    context = foxglove.Context()
    with seated(options) as seat:
        try:
            server = foxglove.start_server(
                name=f"T2 {seat.robot}", host=options.host, port=options.port, context=context
            )
        except (OSError, RuntimeError) as error:
            raise LinkError(f"cannot listen on {options.host}:{options.port}: {error}") from None
        print(f"connect Foxglove or Lichtblick to ws://{options.host}:{server.port}", flush=True)
        for word in EVERYTHING:
            seat.probe.listen(expression(word, seat.robot))
        shown, stage = 0, Stage(context)
        try:
            with quietly():
                for sample in seat.probe.samples(options.duration):
                    for entry in translator.entries(sample, sample.wall_ns):
                        stage.show(entry)
                    shown += 1
                    if shown == options.count:
                        break
        finally:
            server.stop()
    return 0


class Stage:
    """The channels that viewers see, each made when it is first needed."""

    def __init__(self, context: "Context") -> None:
        self._context = context
        self._channels: dict[Channel, Shown] = {}

    def show(self, entry: Entry) -> None:
        """Send a message to all who look at its topic."""
        channel = self._channels.get(entry.channel)
        if channel is None:
            channel = self._channels[entry.channel] = self._made(entry.channel)
        channel.log(entry.data, log_time=entry.log_ns)

    def _made(self, channel: Channel) -> "Shown":
        import foxglove

        schema = None
        if channel.schema:
            name, data = channel.schema.name, channel.schema.data
            schema = foxglove.Schema(name=name, encoding="jsonschema", data=data)
        return foxglove.Channel(
            channel.topic, schema=schema, message_encoding="json", context=self._context
        )
