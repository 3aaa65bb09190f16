# voxdag in a container, on the CPU:
#     docker build -t voxdag .
#     docker run --rm -v "$PWD:/data" --user "$(id -u):$(id -g)" voxdag build scene.glb -r 4096 -o scene.vdag
# or as the service, with tokens made by `voxdag token` (docs/operating.md):
#     docker run -d -p 127.0.0.1:8080:8080 -v voxdag:/data -v "$PWD/tokens:/tokens:ro" voxdag
# On a CUDA base (12 or later), which lets a build that finds nvcc use it:
#     docker build --build-arg BUILD_BASE=nvidia/cuda:12.6.3-devel-ubuntu24.04 \
#                  --build-arg RUN_BASE=nvidia/cuda:12.6.3-base-ubuntu24.04 -t voxdag:cuda .
# Both bases must be the same distribution.
ARG BUILD_BASE=debian:bookworm-slim
ARG RUN_BASE=debian:bookworm-slim

FROM ${BUILD_BASE} AS build
SHELL ["/bin/bash", "-euo", "pipefail", "-c"]
WORKDIR /src
COPY tools/packages tools/packages
RUN tools/packages build
COPY . .
RUN cmake --preset cpu -DVOXDAG_TESTS=OFF -DVOXDAG_BENCH=OFF \
    && cmake --build --preset cpu --target voxdag \
    && install -D --strip build/cpu/voxdag /out/voxdag \
    && ldd /out/voxdag | awk '/=> \//{print $3}' | xargs -n 1 basename | sed 's|^|*/|' \
      | xargs dpkg-query -S | cut -d : -f 1 | sort -u > /out/packages

FROM ${RUN_BASE}
# The packages are those of the libraries the program was linked with: exactly as new as them.
# hadolint ignore=DL3008
RUN --mount=type=bind,from=build,source=/out,target=/out \
    apt-get update \
    && xargs -a /out/packages apt-get install -y --no-install-recommends \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --uid 10001 voxdag \
    && install -d -o voxdag /data
COPY --from=build /out/voxdag /usr/local/bin/voxdag
USER 10001
WORKDIR /data
EXPOSE 8080
ENTRYPOINT ["voxdag"]
# The network is behind that address, so tokens are needed: docs/operating.md.
CMD ["serve", "--listen", "0.0.0.0", "--data", "/data", "--tokens", "/tokens"]
