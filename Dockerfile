# One image for every role, the router and the launcher. Made by `make image`, which fills build/wheels first.
# Plain instructions only: the classic builder and BuildKit both know them.

ARG BASE=python:3.11-slim

FROM ${BASE} AS packages
COPY build/wheels /wheels
RUN python3 -m venv /opt/trackfield && /opt/trackfield/bin/pip install --quiet --no-index /wheels/*.whl

FROM ${BASE}
COPY --from=packages /opt/trackfield /opt/trackfield
ENV PATH=/opt/trackfield/bin:$PATH PYTHONUNBUFFERED=1
COPY pyproject.toml README.md LICENSE /src/
COPY trackfield /src/trackfield
COPY node /src/node
COPY fusion /src/fusion
COPY head /src/head
COPY gateway /src/gateway
COPY camera /src/camera
COPY launcher /src/launcher
RUN pip install --quiet --no-index --no-deps --no-build-isolation /src
WORKDIR /field
CMD ["trackfield", "--help"]
