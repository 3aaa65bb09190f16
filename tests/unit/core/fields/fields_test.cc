// Tests the visitors of fields(): each finds all fields of a description, and no others.
#include <gtest/gtest.h>

#include "core/fields/json_fields.h"
#include "core/fields/json_schema.h"

namespace voxdag {
namespace {

enum class Speed { kNone, kSlow, kFast };
constexpr std::array<const char*, 3> enum_names(Speed) { return {"", "slow", "fast"}; }

struct Stop {
  std::string city{};
  uint64_t checksum = 0;
};

template <class Visitor>
void fields(Visitor& visit, Stop& stop) {
  visit("city", stop.city);
  visit("checksum", stop.checksum);
}

struct Trip {
  std::vector<Stop> stops{};
  std::optional<Stop> last{};
  uint32_t days = 2;
  double total = 10;
  std::string note{};
};

template <class Visitor>
void fields(Visitor& visit, Trip& trip) {
  visit("stops", trip.stops);
  visit("last", trip.last);
  visit("days", trip.days);
  visit.object("cost", [&](auto& cost) { cost("total", trip.total); });
  visit.derived("daily_cost", trip.total / trip.days);
  visit(Field("note").omit_empty(), trip.note);
}

struct Choices {
  uint64_t edge = 0, memory = 0;
  int rank = 0;
  std::optional<double> size{};
  std::optional<std::array<double, 4>> cube{};
  Speed speed = Speed::kNone;
  bool loud = false;
  std::vector<std::string> names{};
};

template <class Visitor>
void fields(Visitor& visit, Choices& choices) {
  visit(Field("edge", "edge of a part").power_of_two(4, 64).required(), choices.edge);
  visit(Field("memory").at_least(int64_t{64} << 20).bytes().unset_means("half the RAM"),
        choices.memory);
  visit(Field("rank").range(-3, 3), choices.rank);
  visit.object("options", [&](auto& options) {
    options(Field("cube").with(&Field::parts, "X,Y,Z,EDGE").above_zero(), choices.cube);
    options(Field("size").above_zero().excludes("cube"), choices.size);
    options("speed", choices.speed);
    options("loud", choices.loud);
  });
  visit(Field("names").line(5).items(2), choices.names);
}

TEST(RecordJson, HasAllMembersInTheOrderOfTheDescription) {
  const Trip trip{.stops = {{"Rome", ~uint64_t{0}}, {"Oslo", 1}}, .total = 7};
  const std::string text = record_json(trip).dump();
  EXPECT_EQ(text,
            R"({"stops":[{"city":"Rome","checksum":18446744073709551615},)"
            R"({"city":"Oslo","checksum":1}],"days":2,"cost":{"total":7.0},"daily_cost":3.5})");
  const auto back = record_from_text<Trip>(text, "a trip");
  EXPECT_EQ(record_json(back).dump(), text);
  EXPECT_EQ(back.stops.front().checksum, ~uint64_t{0});
}

TEST(RecordJson, LeavesOutWhatIsEmpty) {
  EXPECT_FALSE(record_json(Trip{}).contains("last"));
  EXPECT_TRUE(record_json(Trip{.last = Stop{}}).contains("last"));
  EXPECT_EQ(record_json(Trip{.note = "x"}).at("note"), "x");
}

TEST(RecordJson, IsCorruptWithoutAMember) {
  for (const char* text :
       {"", "[]", "{}", R"({"stops":[],"days":-1,"cost":{"total":1}})",
        R"({"stops":[],"days":1,"cost":{}})", R"({"stops":[{}],"days":1,"cost":{"total":1}})"}) {
    SCOPED_TRACE(text);
    try {
      record_from_text<Trip>(text, "a trip");
      ADD_FAILURE() << "was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
      EXPECT_EQ(error.message().find("a trip"), 0u) << error.message();
    }
  }
}

TEST(OptionsJson, HasTheMembersThatDifferFromTheirDefaults) {
  EXPECT_EQ(options_json(Choices{}).dump(), "{}");
  EXPECT_EQ(options_json(Choices{.edge = 8, .size = 0.5, .speed = Speed::kFast}).dump(),
            R"({"edge":8,"options":{"size":0.5,"speed":"fast"}})");
}

TEST(OptionsJson, SetsWhatIsGiven) {
  Choices choices;
  set_options(FieldJson::parse(R"({"edge":16.0,"memory":"2GiB","rank":-3,"names":"ab",
                                   "options":{"cube":[0,-1,2,0.5],"speed":"slow"}})"),
              "the body", choices);
  EXPECT_EQ(choices.edge, 16u);
  EXPECT_EQ(choices.memory, uint64_t{2} << 30);
  EXPECT_EQ(choices.rank, -3);
  EXPECT_EQ(choices.cube, (std::array<double, 4>{0, -1, 2, 0.5}));
  EXPECT_EQ(choices.speed, Speed::kSlow);
  EXPECT_EQ(choices.names, std::vector<std::string>{"ab"});
}

TEST(OptionsJson, IsRefusedByNameAndExpectation) {
  const std::pair<const char*, const char*> bodies[] = {
      {"[]", "'the body': expected an object, not []"},
      {"{}", "'edge': expected a power of two from 4 to 64, but the member is missing"},
      {R"({"edge":12})", "'edge': expected a power of two"},
      {R"({"edge":4.5})", "'edge'"},
      {R"({"edge":4,"memory":"1MiB"})", "'memory': expected a size of at least 64MiB"},
      {R"({"edge":4,"memory":"much"})",
       "'memory': expected a size of at least 64MiB, such as 8GiB, not \"much\""},
      {R"({"edge":4,"rank":4})", "'rank': expected a whole number from -3 to 3"},
      {R"({"edge":4,"names":[]})", "'names': expected 1 to 2 items"},
      {R"({"edge":4,"names":["abcdef"]})", "'names': expected 1 to 5 characters"},
      {R"({"edge":4,"names":["a\n"]})", "'names'"},
      {R"({"edge":4,"options":{"cube":[0,0,0,0]}})",
       "'cube': expected 4 finite numbers X,Y,Z,EDGE, the last one above 0, not [0,0,0,0]"},
      {R"({"edge":4,"options":{"speed":""}})", "'speed': expected one of slow, fast, not \"\""},
      {R"({"edge":4,"options":{"loud":1}})", "'loud': expected true or false, not 1"},
      {R"({"edge":4,"options":{"color":1}})", "'color': expected a documented member of options"},
      {R"({"edge":4,"speed":"slow"})",
       "'speed': expected a documented member of the body; this member is unknown; did you mean "
       "'options.speed'?"},
  };
  for (const auto& [body, part] : bodies) {
    SCOPED_TRACE(body);
    Choices choices;
    try {
      set_options(FieldJson::parse(body), "the body", choices);
      ADD_FAILURE() << "was accepted";
    } catch (const FieldError& error) {
      EXPECT_EQ(error.message().find(part), 0u) << error.message();
    }
  }
}

TEST(ParseText, ReadsWhatACommandLineGives) {
  const auto edge = Field("edge").power_of_two(4, 64);
  uint64_t number = 0;
  EXPECT_TRUE(parse_text(edge, "16", number));
  EXPECT_EQ(number, 16u);
  for (const char* text : {"12", "128", "-4", "4.0", "", "4k"})
    EXPECT_FALSE(parse_text(edge, text, number)) << text;
  std::optional<std::array<double, 4>> cube;
  const auto parts = Field("cube").above_zero();
  EXPECT_TRUE(parse_text(parts, "0,0,-1e3,2.5", cube));
  EXPECT_EQ(cube->back(), 2.5);
  for (const char* text : {"0,0,0", "0,0,0,0", "0,nan,0,1", "1,2,3,4,5"})
    EXPECT_FALSE(parse_text(parts, text, cube)) << text;
  Speed speed{};
  EXPECT_TRUE(parse_text("speed", "fast", speed));
  EXPECT_FALSE(parse_text("speed", "", speed));
}

TEST(Schema, OfARecordRequiresItsMembers) {
  const FieldJson schema = record_schema<Trip>();
  EXPECT_EQ(schema.at("required").dump(), R"(["stops","days","cost","daily_cost"])");
  EXPECT_EQ(schema["properties"]["stops"]["items"]["properties"]["checksum"].dump(),
            R"({"type":"integer","minimum":0})");
  EXPECT_EQ(schema["properties"]["cost"]["required"].dump(), R"(["total"])");
}

TEST(Schema, OfOptionsHasTheirLimits) {
  const FieldJson schema = options_schema<Choices>();
  EXPECT_EQ(schema.at("required").dump(), R"(["edge"])");
  EXPECT_EQ(schema.at("additionalProperties"), false);
  const FieldJson& all = schema.at("properties");
  EXPECT_EQ(all.at("edge").dump(),
            R"({"type":"integer","enum":[4,8,16,32,64],"description":"edge of a part"})");
  EXPECT_EQ(all.at("rank").dump(), R"({"type":"integer","minimum":-3,"maximum":3})");
  const FieldJson& options = all.at("options");
  EXPECT_EQ(options.at("not").dump(), R"({"required":["cube","size"]})");
  EXPECT_EQ(options["properties"]["speed"].dump(), R"({"type":"string","enum":["slow","fast"]})");
}

TEST(EdgeOfText, AcceptsUnits) {
  const std::pair<const char*, uint64_t> rows[] = {
      {"4096", 4096}, {"4k", 4096}, {"4K", 4096}, {"4Ki", 4096}, {"1M", 1 << 20}, {"1Mi", 1 << 20}};
  for (const auto& [text, edge] : rows) EXPECT_EQ(edge_of_text(text), edge) << text;
  for (const char* text :
       {"", "k", "-4", "4m", "4kk", "4kB", "4 k", "1.5k", "99999999999999999999"})
    EXPECT_EQ(edge_of_text(text), std::nullopt) << text;
}

}  // namespace
}  // namespace voxdag
