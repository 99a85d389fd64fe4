# The package with OpenFOAM on Debian 12, for a user without rights:
#   docker build -t ellipsoid_coupling .
#   docker run --rm -v "$PWD":/work ellipsoid_coupling run cavity --model rho_mono_kinetic
# Run folders appear in the folder that is mounted at /work; with --user "$(id -u):$(id -g)" they are yours.
FROM debian:12-slim

# python3-venv makes /opt/venv; openfoam brings icoFoam, blockMesh and the rest.
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3 python3-venv openfoam \
    && rm -rf /var/lib/apt/lists/*

COPY . /opt/ellipsoid_coupling
# Exactly the versions of run.sh, then the package itself as a wheel.
RUN python3 -m venv /opt/venv \
    && /opt/venv/bin/pip install --no-cache-dir --require-hashes -r /opt/ellipsoid_coupling/workflows/requirements.lock \
    && /opt/venv/bin/pip install --no-cache-dir --no-deps --no-build-isolation /opt/ellipsoid_coupling \
    && rm -rf /opt/ellipsoid_coupling

# Compiled kernels and solved flows; whoever runs the container may write there.
ENV PATH="/opt/venv/bin:$PATH" ELLIPSOID_CACHE=/cache
RUN useradd --create-home --uid 1000 ellipsoid \
    && mkdir /cache /work && chmod 1777 /cache /work
USER ellipsoid
WORKDIR /work
ENTRYPOINT ["ellipsoid"]
CMD ["--help"]
