"""Zenoh's sample to ours."""

import zenoh

from common.sample import Sample


def copied(sample: zenoh.Sample, received_ns: int, wall_ns: int) -> Sample:
    """Return the same without Zenoh's buffers."""
    return Sample(
        key=str(sample.key_expr),
        payload=sample.payload.to_bytes(),
        encoding=str(sample.encoding),
        deleted=sample.kind == zenoh.SampleKind.DELETE,
        raw=sample.attachment.to_bytes() if sample.attachment else None,
        received_ns=received_ns,
        wall_ns=wall_ns,
    )
