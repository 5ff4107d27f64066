# adv2e in a container: docker build -t adv2e .
#                       docker run --rm -v "$PWD:/data" adv2e convert clip.mp4
# Give it your own user where the folder is not writable to others: docker run --user "$(id -u)" ...
FROM python:3.12-slim AS build
WORKDIR /src
COPY pyproject.toml README.md LICENSE ./
COPY adv2e adv2e
COPY configs configs
RUN pip wheel --no-cache-dir --wheel-dir /wheels ".[aedat4,bag,blosc,fast]"

FROM python:3.12-slim
# versions are those of the wheels; no index is asked
# hadolint ignore=DL3013
RUN --mount=type=bind,from=build,source=/wheels,target=/wheels \
    pip install --no-cache-dir --no-index --find-links /wheels "adv2e[aedat4,bag,blosc,fast]" \
    && useradd --create-home --uid 1000 adv2e \
    && install --directory --owner adv2e --mode 0777 /data /cache
# compiled code stays in the volume, if one is given: -v adv2e-cache:/cache
ENV XDG_CACHE_HOME=/cache
USER 1000
WORKDIR /data
ENTRYPOINT ["adv2e"]
CMD ["--help"]
