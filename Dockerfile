# One image, two targets: `robot` holds what the industrial PC needs, `laptop` adds the operator's.
ARG BASE=python:3.13-slim
FROM ${BASE} AS robot
ENV PYTHONUNBUFFERED=1 PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
WORKDIR /opt/t2
COPY requirements-robot.lock ./
RUN python3 -m venv /opt/venv \
 && /opt/venv/bin/pip install --quiet --require-hashes -r requirements-robot.lock
ENV PATH=/opt/venv/bin:$PATH
COPY common common
COPY services services
COPY sim sim
COPY cli cli
COPY config config
RUN useradd --system --no-create-home t2 && install -d -o t2 /recordings
USER t2
ENTRYPOINT ["python", "-m"]

FROM robot AS laptop
USER root
COPY requirements-laptop.lock ./
RUN /opt/venv/bin/pip install --quiet --require-hashes -r requirements-laptop.lock
USER t2
ENTRYPOINT ["python", "-m", "cli"]
