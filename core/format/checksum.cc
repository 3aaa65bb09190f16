#include "core/format/checksum.h"

#include <openssl/evp.h>
#include <xxhash.h>

#include <algorithm>
#include <new>
#include <vector>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxdag {

uint64_t checksum64(std::span<const std::byte> bytes) {
  return XXH64(bytes.data(), bytes.size(), 0);
}

Checksum128 checksum128(std::span<const std::byte> bytes) {
  const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
  return {hash.low64, hash.high64};
}

struct Checksum64::State {
  XXH64_state_t* hash = XXH64_createState();
  ~State() { XXH64_freeState(hash); }
};

Checksum64::Checksum64() : state_(std::make_unique<State>()) {
  if (!state_->hash) throw std::bad_alloc();
  reset();
}

Checksum64::Checksum64(Checksum64&&) noexcept = default;
Checksum64& Checksum64::operator=(Checksum64&&) noexcept = default;
Checksum64::~Checksum64() = default;

void Checksum64::add(std::span<const std::byte> bytes) {
  XXH64_update(state_->hash, bytes.data(), bytes.size());
}

uint64_t Checksum64::value() const { return XXH64_digest(state_->hash); }

void Checksum64::reset() { XXH64_reset(state_->hash, 0); }

uint64_t indexed_checksum(uint64_t first, std::span<const uint32_t> words) {
  constexpr uint64_t kOdd = 0x9e3779b97f4a7c15;
  uint64_t sum = 0;
  for (size_t i = 0; i < words.size(); ++i) {
    const uint64_t mixed = (first + i) * kOdd;
    // The weight is odd, so every change of a word changes its product.
    const uint64_t weight = (mixed ^ (mixed >> 29)) | 1;
    sum += (words[i] + kOdd) * weight;
  }
  return sum;
}

struct Sha256::Context {
  EVP_MD_CTX* md = EVP_MD_CTX_new();
  ~Context() { EVP_MD_CTX_free(md); }
};

namespace {

void check(int status) {
  if (status != 1)
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: libcrypto cannot compute a SHA-256: expected more free memory");
}

}  // namespace

Sha256::Sha256() : context_(std::make_unique<Context>()) {
  check(context_->md && EVP_DigestInit_ex(context_->md, EVP_sha256(), nullptr) == 1);
}

Sha256::~Sha256() = default;

void Sha256::add(std::span<const std::byte> bytes) {
  check(EVP_DigestUpdate(context_->md, bytes.data(), bytes.size()));
}

std::string Sha256::finish() {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned size = 0;
  check(EVP_DigestFinal_ex(context_->md, digest, &size));
  return hex_text({digest, size});
}

std::string sha256_hex(std::string_view text) {
  Sha256 digest;
  digest.add(std::as_bytes(std::span(text)));
  return digest.finish();
}

std::string sha256_of_file(const ReadableFile& file, const CancelToken& cancel,
                           Progress* progress) {
  Sha256 digest;
  std::vector<std::byte> buffer(size_t{1} << 20);
  for (uint64_t at = 0; at < file.size(); at += buffer.size()) {
    cancel.check();
    const auto piece = std::span(buffer).first(std::min(buffer.size(), file.size() - at));
    file.read_at(at, piece);
    digest.add(piece);
    if (progress) progress->advance(piece.size());
  }
  return digest.finish();
}

std::string digest_field(const std::string& sha256) {
  unsigned char bytes[32], base64[45];
  for (size_t i = 0; i < sizeof bytes; ++i)
    bytes[i] = static_cast<unsigned char>(std::stoi(sha256.substr(2 * i, 2), nullptr, 16));
  EVP_EncodeBlock(base64, bytes, sizeof bytes);
  return "sha-256=:" + std::string(reinterpret_cast<char*>(base64)) + ":";
}

}  // namespace voxdag
