"""The running stack, routers, certificates and clients that verification and tests share."""
