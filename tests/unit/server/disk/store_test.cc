#include "server/disk/store.h"

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::server {
namespace {

constexpr StoreFormat kCups = {"records of cups",
                               "cups",
                               0x63757073,
                               2,
                               "CREATE TABLE cup (name TEXT)",
                               "ALTER TABLE cup ADD size INTEGER"};

StoreFormat with_version(int64_t version) {
  StoreFormat format = kCups;
  format.version = version;
  return format;
}

TEST(Store, IsNotCreatedForFilesWithoutRecords) {
  const TemporaryFolder folder;
  const Error error = error_of([&] { open_store(folder.file("cups.db"), kCups, false); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
  EXPECT_NE(error.message().find("--adopt"), std::string::npos) << error.message();
}

TEST(Store, IsUpgradedByOneVersion) {
  const TemporaryFolder folder;
  const std::string path = folder.file("cups.db");
  open_store(path, with_version(1), true);
  SqlDatabase database = open_store(path, kCups, false);
  EXPECT_EQ(database.integer("PRAGMA user_version"), 2);
  EXPECT_NO_THROW(database.execute("INSERT INTO cup (name, size) VALUES ('tea', 3)"));
}

TEST(Store, RefusesOtherVersionsAndOtherStores) {
  const TemporaryFolder folder;
  const std::string path = folder.file("cups.db");
  open_store(path, with_version(4), true);
  EXPECT_EQ(error_of([&] { open_store(path, kCups, true); }).code(),
            ErrorCode::kUnsupportedVersion);
  StoreFormat plates = with_version(4);
  plates.application_id = 1;
  EXPECT_EQ(error_of([&] { open_store(path, plates, true); }).code(), ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace voxdag::server
