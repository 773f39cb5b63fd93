# docker build -t heba . && docker run --rm -v "$PWD":/data heba run /data/config.yaml
FROM debian:bookworm AS build
COPY . /heba
RUN /heba/tools/package.sh && cp /heba/build/package/heba_*.deb /heba.deb

FROM debian:bookworm-slim
COPY --from=build /heba.deb /tmp/heba.deb
RUN apt-get update && apt-get install -y --no-install-recommends /tmp/heba.deb && rm -rf /tmp/heba.deb /var/lib/apt/lists/*
WORKDIR /data
ENTRYPOINT ["heba"]
