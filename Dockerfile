# The images of a field, made by `make image`, which fills build/wheels first: `node` for processes that sense and send,
# `full` for all others, the router and the launcher (docs/containers.md). The classic builder and BuildKit both know these
# instructions.

ARG BASE=python:3.11-slim

# Packages go into an environment without pip, by a pip that stays here. Of Trackfield itself that has the command and the
# entry points; its code comes last, since it changes most.
FROM ${BASE} AS packages
COPY build/wheels /wheels
COPY pyproject.toml LICENSE /src/
RUN touch /src/README.md && python3 -m venv /tools && python3 -m venv --without-pip /opt/trackfield
ENV PIP_PYTHON=/opt/trackfield/bin/python PIP_NO_INDEX=1 PIP_FIND_LINKS=/wheels

FROM packages AS light
RUN /tools/bin/pip install --quiet /src

FROM ${BASE} AS roles
COPY trackfield /opt/source/trackfield
COPY node /opt/source/node
COPY fusion /opt/source/fusion
COPY head /opt/source/head
COPY gateway /opt/source/gateway
COPY camera /opt/source/camera
RUN python3 -m compileall -q /opt/source

# Whose process it is, and that it writes only into /tmp and the folder of runs.
FROM ${BASE} AS ground
ENV PATH=/opt/trackfield/bin:$PATH PYTHONPATH=/opt/source PYTHONUNBUFFERED=1 HOME=/tmp
RUN mkdir -p /field/runs && chown 10001:10001 /field/runs
USER 10001:10001
WORKDIR /field

FROM ground AS node
COPY --from=light /opt/trackfield /opt/trackfield
COPY --from=roles /opt/source /opt/source
CMD ["python3", "-m", "node", "--help"]

FROM packages AS heavy
ARG EXTRAS=run
RUN /tools/bin/pip install --quiet "/src[${EXTRAS}]" && \
    find /opt/trackfield -type d -name tests -prune -exec rm -r {} +

FROM roles AS source
COPY launcher /opt/source/launcher
RUN python3 -m compileall -q /opt/source/launcher

FROM ground AS full
COPY --from=heavy /opt/trackfield /opt/trackfield
COPY --from=source /opt/source /opt/source
CMD ["trackfield", "--help"]
