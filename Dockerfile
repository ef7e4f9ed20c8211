# How to run it beside a dockserver: docs/install.md, "Docker".
FROM python:3.13-slim AS base
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1 PIP_ROOT_USER_ACTION=ignore

# The project's wheel, built with the locked build tools.
FROM base AS wheel
WORKDIR /src
COPY requirements-dev.lock .
RUN pip install --require-hashes --prefer-binary -r requirements-dev.lock
COPY . .
RUN pip wheel --no-deps --no-build-isolation --no-index -w /wheels .

# On ARM dbdreader comes as source; without a compiler its own, slower, decoder is installed.
FROM base AS install
RUN python -m venv /opt/gliderwatch
COPY requirements.lock .
RUN /opt/gliderwatch/bin/pip install --require-hashes --prefer-binary -r requirements.lock
COPY --from=wheel /wheels /wheels
RUN /opt/gliderwatch/bin/pip install --no-deps --no-index /wheels/*.whl

FROM python:3.13-slim
LABEL org.opencontainers.image.title="gliderwatch" \
      org.opencontainers.image.licenses="GPL-3.0-or-later"
RUN useradd --system --uid 10001 --user-group --no-create-home --home-dir /var/lib/gliderwatch gliderwatch \
    && install -d -o gliderwatch -g gliderwatch -m 0700 /var/lib/gliderwatch
COPY --from=install /opt/gliderwatch /opt/gliderwatch
# Nothing is written but the state and /tmp: the root file system may be read-only.
ENV PATH=/opt/gliderwatch/bin:$PATH HOME=/var/lib/gliderwatch \
    PYTHONDONTWRITEBYTECODE=1 PYTHONUNBUFFERED=1 OPENBLAS_NUM_THREADS=1
USER 10001:10001
WORKDIR /var/lib/gliderwatch
VOLUME /var/lib/gliderwatch
STOPSIGNAL SIGTERM
# `status` fails when the daemon's heartbeat is old.
HEALTHCHECK --interval=60s --timeout=20s --start-period=120s --retries=3 \
    CMD ["gliderwatch", "status", "-c", "/etc/gliderwatch/gliderwatch.yml", "--json"]
ENTRYPOINT ["gliderwatch"]
CMD ["run", "-c", "/etc/gliderwatch/gliderwatch.yml"]
