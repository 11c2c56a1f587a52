"""``t2 foxglove``: a live WebSocket server for Foxglove or Lichtblick."""

import argparse
from functools import cache, partial
from typing import TYPE_CHECKING

from cli.inspect.addressing import EVERYTHING, expression
from cli.inspect.session import add_options, open_session, until_interrupt
from common.cli_args import needs_extra, sources
from common.config import load
from services.recorder.config import RecorderConfig
from services.recorder.mcap_codec import Channel, Encoder
from t2.errors import LinkError

if TYPE_CHECKING:
    from foxglove import Channel as FoxgloveChannel
    from foxglove import Context

PORT = 8765  # the viewers' default


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "--host", default="127.0.0.1", help="address to listen on; 0.0.0.0 for the whole network"
    )
    parser.add_argument("--port", type=int, default=PORT, help=f"port, {PORT} by default")
    add_options(parser, every=False)


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C; raise ``LinkError`` if the port is not available."""
    with needs_extra("foxglove", "the server"):
        import foxglove
    encoder = Encoder(load(RecorderConfig, sources(options)).config.vehicle)
    context = foxglove.Context()
    with open_session(options) as session:
        try:
            server = foxglove.start_server(
                name=f"T2 {session.robot}", host=options.host, port=options.port, context=context
            )
        except (OSError, RuntimeError) as error:
            raise LinkError(f"cannot listen on {options.host}:{options.port}: {error}") from None
        print(f"connect Foxglove or Lichtblick to ws://{options.host}:{server.port}", flush=True)
        for word in EVERYTHING:
            session.inspector.listen(expression(word, session.robot))
        channel_of = cache(partial(create_channel, context))
        try:
            with until_interrupt():
                for sample in session.inspector.samples():
                    for entry in encoder.entries(sample, sample.wall_ns):
                        channel_of(entry.channel).log(entry.data, log_time=entry.log_ns)
        finally:
            server.stop()
    return 0


def create_channel(context: "Context", channel: Channel) -> "FoxgloveChannel":
    """Create a channel of the server."""
    import foxglove

    schema = None
    if channel.schema:
        name, data = channel.schema.name, channel.schema.data
        schema = foxglove.Schema(name=name, encoding="jsonschema", data=data)
    return foxglove.Channel(channel.topic, schema=schema, message_encoding="json", context=context)
