# voxdag in a container, on the CPU:
#     docker build -t voxdag .
#     docker run --rm -v "$PWD:/data" --user "$(id -u):$(id -g)" voxdag build scene.glb -r 4096 -o scene.vdag
# The service, with tokens made by `voxdag token` (docs/operating.md):
#     docker run -d -p 127.0.0.1:8080:8080 -v voxdag:/data -v "$PWD/tokens:/tokens:ro" voxdag
# With the CUDA backend, on base images that contain CUDA 12 or later (the build finds nvcc in
# them):
#     docker build --build-arg BUILD_BASE=nvidia/cuda:12.6.3-devel-ubuntu24.04 \
#                  --build-arg RUN_BASE=nvidia/cuda:12.6.3-base-ubuntu24.04 -t voxdag:cuda .
# Both base images must have the same distribution. Without docker and a registry, `tools/release image`
# builds this file on a base image made by debootstrap; `tools/check-image` tests the image.
ARG BUILD_BASE=debian:bookworm-slim@sha256:3783cc01769c7b2b1b83a5c5ad96c815348e28ed7da68e2e3687004faa906251
ARG RUN_BASE=debian:bookworm-slim@sha256:3783cc01769c7b2b1b83a5c5ad96c815348e28ed7da68e2e3687004faa906251

FROM ${BUILD_BASE} AS build
SHELL ["/bin/bash", "-euo", "pipefail", "-c"]
WORKDIR /src
COPY tools/packages tools/packages
RUN tools/packages build
COPY . .
RUN cmake --preset quick \
    && cmake --build --preset quick --target voxdag manual \
    && cmake --install build/quick --component program --strip --prefix /out/local \
    && ldd /out/local/bin/voxdag /out/local/lib/voxdag/*.so | awk '/=> \//{print $3}' \
      | xargs -n 1 basename | sort -u | sed 's|^|*/|' | xargs dpkg-query -S | cut -d : -f 1 | sort -u > /out/packages

FROM ${RUN_BASE}
ARG VERSION=0.1.0
LABEL org.opencontainers.image.title="voxdag" \
      org.opencontainers.image.description="Builds sparse voxel DAGs of scenes that are larger than memory" \
      org.opencontainers.image.version="${VERSION}" \
      org.opencontainers.image.licenses="Apache-2.0"
COPY --from=build /out/packages /usr/share/voxdag/packages
# Installs the packages of the libraries with which the program was linked. ca-certificates lets the
# client commands verify a service's certificate.
# hadolint ignore=DL3008
RUN apt-get update \
    && xargs -a /usr/share/voxdag/packages apt-get install -y --no-install-recommends ca-certificates \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --uid 10001 voxdag \
    && install -d -m 1777 /data
COPY --from=build /src/LICENSE /usr/share/doc/voxdag/LICENSE
COPY --from=build /out/local /usr/local
USER 10001
WORKDIR /data
EXPOSE 8080
HEALTHCHECK --interval=30s --timeout=10s CMD ["voxdag", "health"]
ENTRYPOINT ["voxdag"]
# The service listens on all addresses of the container, so it requires tokens: docs/operating.md.
CMD ["serve", "--listen", "0.0.0.0", "--data", "/data", "--tokens", "/tokens"]
