FROM debian:trixie-slim

# DOLFINx 0.9 with PETSc in real numbers, a fast BLAS for it, and all else fxcrack depends on.
RUN apt-get update \
 && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
        libopenblas0-pthread \
        openmpi-bin \
        python3-dolfinx-real \
        python3-gmsh \
        python3-hypothesis \
        python3-matplotlib \
        python3-pip \
        python3-pytest \
        python3-pytest-xdist \
        python3-rich \
        python3-scipy \
        python3-setuptools \
        python3-typer \
        python3-wheel \
 && rm -rf /var/lib/apt/lists/*

# Ranks share the cores of one machine; any user id may run the image and write what it must.
ENV HOME=/home/fxcrack \
    MPLBACKEND=Agg \
    OMP_NUM_THREADS=1 \
    OMPI_MCA_btl=self,sm \
    PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe
RUN useradd --create-home fxcrack \
 && mkdir -p /home/fxcrack/.cache/fenics /opt/fxcrack /out \
 && chmod 1777 /home/fxcrack /home/fxcrack/.cache /home/fxcrack/.cache/fenics /opt/fxcrack /out

# From here on a change of the sources costs seconds.
WORKDIR /opt/fxcrack
COPY . .
RUN pip install --no-index --no-deps --no-build-isolation --break-system-packages --no-cache-dir . \
 && rm -rf build fxcrack fxcrack.egg-info

# The tests stay in /opt/fxcrack and meet the installed package, not its sources:
#   docker run IMAGE .ci/test quick
USER fxcrack
CMD ["fxcrack", "demo", "dcb", "--out", "/out"]
