# innerattn in a container, for the CPU:
#
#   docker build -t innerattn .
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/work" innerattn demo
#
# EXTRAS chooses what is installed beside the worlds: `--build-arg EXTRAS=` leaves out PyTorch and with it training.

# What compiles the worlds and runs `make`; .devcontainer uses it, too.
FROM debian:trixie-slim AS tools
RUN sed -i '0,/^Suites: trixie/s//Suites: trixie trixie-backports/' /etc/apt/sources.list.d/debian.sources \
 && apt-get update \
 && apt-get install -y --no-install-recommends -t trixie-backports cargo rustc rust-clippy rustfmt \
 && apt-get install -y --no-install-recommends \
      ca-certificates chromium-headless-shell g++ git make python3-dev python3-venv \
 && rm -rf /var/lib/apt/lists/*

FROM tools AS wheel
WORKDIR /source
COPY . .
RUN python3 -m venv /maturin \
 && /maturin/bin/pip install --no-cache-dir 'maturin>=1.10,<2' \
 && /maturin/bin/maturin build --release --locked --out /wheels

FROM debian:trixie-slim
ARG EXTRAS=train,report
ARG PIP_EXTRA_INDEX_URL=
COPY constraints.txt /opt/
# PyTorch compiles what it trains with g++ and the headers of Python.
RUN --mount=type=bind,from=wheel,source=/wheels,target=/wheels \
    apt-get update \
 && apt-get install -y --no-install-recommends ca-certificates python3-venv ${EXTRAS:+g++ python3-dev} \
 && rm -rf /var/lib/apt/lists/* \
 && python3 -m venv /opt/innerattn \
 && /opt/innerattn/bin/pip install --no-cache-dir -c /opt/constraints.txt "$(echo /wheels/*.whl)${EXTRAS:+[$EXTRAS]}"
ENV PATH=/opt/innerattn/bin:$PATH
WORKDIR /work
ENTRYPOINT ["innerattn"]
CMD ["--help"]
