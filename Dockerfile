# sim-action in a container: docs/workflow/docker.md
#   docker build --tag sim-action .
#   docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/work" sim-action run .

# PyBullet has wheels for Python 3.11 alone. A release passes this image with its digest: python:3.11-slim@sha256:...
ARG BASE=python:3.11-slim
# hadolint ignore=DL3006 # the argument has the tag
FROM $BASE

LABEL org.opencontainers.image.title="sim-action" \
      org.opencontainers.image.description="Simulation tests for robots, on the command line" \
      org.opencontainers.image.source="https://github.com/sim-action/sim-action" \
      org.opencontainers.image.licenses="Apache-2.0"

# Only wheels with the hashes of the lock file. The folders that are removed are examples of PyBullet: half of its size.
COPY action/locks/requirements.lock /opt/sim-action/
RUN python -m pip install --root-user-action ignore --disable-pip-version-check --no-cache-dir --no-deps \
      --only-binary :all: --require-hashes --requirement /opt/sim-action/requirements.lock \
    && site="$(python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')" \
    && rm -rf "$site"/pybullet_data "$site"/pybullet_envs "$site"/eglRenderer.*.so \
    && echo /opt/sim-action > "$site/sim-action.pth"

COPY LICENSE /opt/sim-action/
COPY sim_action /opt/sim-action/sim_action
# Files keep the modes of the build machine, and the user of the container must be able to read them.
RUN chmod -R a+rX /opt/sim-action \
    && python -m compileall -q /opt/sim-action \
    && printf '%s\n' '#!/bin/sh' 'exec /usr/local/bin/python -P -m sim_action "$@"' > /usr/local/bin/sim-action \
    && chmod a+rx /usr/local/bin/sim-action

# Any user may run it, also one without a name and without a home: --user.
ENV HOME=/tmp
USER 1000:1000
WORKDIR /work
ENTRYPOINT ["sim-action"]
CMD ["--help"]
