#include "core/format/checksum.h"

#include <openssl/evp.h>
#include <xxhash.h>

#include <new>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxdag {

uint64_t checksum64(std::span<const std::byte> bytes) {
  return XXH64(bytes.data(), bytes.size(), 0);
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
  if (status != 1) throw Error(ErrorCode::kOutOfMemory, "libcrypto cannot compute a SHA-256");
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

}  // namespace voxdag
