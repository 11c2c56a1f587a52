# Three images, each based on the previous one: `robot` for the industrial PC, `dashboard` adds the web
# page and the camera, `laptop` adds the operator's tools.
#
# BASE is any Debian with Python 3.11 or newer and venv. The images contain only its Python and its C
# libraries: no shell, no pip, no package manager. Wheels come from build/wheelhouse (`make wheelhouse
# SET=laptop`) if it exists, including T2's own; otherwise from pip's index, and T2 from this folder.
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
# A new volume takes over the owner of the folder that it is mounted on.
COPY --from=build --chown=10001:10001 /opt/empty /run/t2
# Copied subfolders keep their mode; bridge and safety need 700.
COPY --from=build --chown=10001:10001 /opt/private /run
COPY --from=build --chown=10001:10001 /opt/empty /recordings
COPY --from=build --chown=10001:10001 /opt/empty /patrol
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
