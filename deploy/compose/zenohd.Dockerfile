# Overlays cannot remove a `build:`, so another image is built from its name.
ARG ROUTER=eclipse/zenoh:1.10.2
FROM ${ROUTER} AS zenohd
