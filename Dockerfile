# Three images, each on top of the one before: `robot` holds what the industrial PC needs, `dashboard`
# adds the page, `laptop` the operator's tools.
#
# BASE is any Debian that has Python 3.11 or newer with its venv. It builds, and lends the images its
# Python and its C libraries. Nothing else of it is in them: no shell, no pip, no package manager.
# Wheels come from build/wheelhouse (`make wheelhouse SET=laptop`) where there is one, T2's own among
# them; else from pip's index, and T2 from this folder.
ARG BASE=python:3.13-slim

FROM ${BASE} AS build
LABEL t2.stage=build
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore
COPY . /opt/src
RUN cd /opt/src/deploy/image && sh install.sh requirements-robot.lock && sh install.sh t2 \
 && sh collect.sh /opt/robot

FROM scratch AS robot
COPY --from=build /opt/robot /
COPY deploy/image/etc /etc
# A volume that is mounted here for the first time takes over whose folder it is.
COPY --from=build --chown=10001:10001 /opt/empty /run/t2
# Of what is copied, a folder inside keeps its mode; bridge and safety want 700.
COPY --from=build --chown=10001:10001 /opt/private /run
COPY --from=build --chown=10001:10001 /opt/empty /recordings
ENV PATH=/opt/venv/bin HOME=/tmp LANG=C.UTF-8 PYTHONUNBUFFERED=1
USER 10001:10001
ENTRYPOINT ["python", "-m"]

FROM build AS build-dashboard
RUN cd /opt/src/deploy/image && sh install.sh requirements-dashboard.lock \
 && sh collect.sh /opt/dashboard

FROM robot AS dashboard
COPY --from=build-dashboard /opt/dashboard /

FROM build-dashboard AS build-laptop
RUN cd /opt/src/deploy/image && sh install.sh requirements-laptop.lock && sh collect.sh /opt/laptop

FROM dashboard AS laptop
COPY --from=build-laptop /opt/laptop /
ENTRYPOINT ["t2"]
