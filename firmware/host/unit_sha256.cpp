// SHA-256 against FIPS 180-4's examples, HMAC against RFC 4231.
#include <string.h>

#include <algorithm>

#include "key_proof.h"
#include "signed_frames.h"
#include "sha256.h"
#include "unit.h"

using unit::Bytes;
using unit::bytes;

namespace {

std::string sha(const std::string& text, size_t step = 1000) {
  patrol::Sha256 hash;
  for (size_t at = 0; at < text.size(); at += step) hash.update(text.data() + at, std::min(step, text.size() - at));
  Bytes digest(patrol::kDigestSize);
  hash.finish(digest.data());
  return unit::hex(digest);
}

std::string hmac(const Bytes& key, const Bytes& data) {
  patrol::HmacSha256 mac(key.data(), key.size());
  mac.update(data.data(), data.size());
  Bytes digest(patrol::kDigestSize);
  mac.finish(digest.data());
  return unit::hex(digest);
}

Bytes text(const char* value) { return Bytes(value, value + strlen(value)); }

}  // namespace

TEST(sha256_of_the_standards_examples) {
  EQUAL(sha(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EQUAL(sha("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EQUAL(sha("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
        "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EQUAL(sha(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(sha256_does_not_mind_how_the_bytes_come) {
  const std::string long_text(300, 'x');
  for (size_t step = 1; step < 140; ++step) EQUAL(sha(long_text, step), sha(long_text));
}

TEST(hmac_of_rfc_4231) {
  EQUAL(hmac(Bytes(20, 0x0b), text("Hi There")), "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7");
  EQUAL(hmac(text("Jefe"), text("what do ya want for nothing?")),
        "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
  EQUAL(hmac(Bytes(20, 0xaa), Bytes(50, 0xdd)), "773ea91e36800e46854db8ebd09181a72959098b3ef8c122d9635514ced565fe");
  Bytes counting;
  for (uint8_t i = 1; i <= 25; ++i) counting.push_back(i);
  EQUAL(hmac(counting, Bytes(50, 0xcd)), "82558a389a443c0ea4cc819899f2083a85f0faa3e578f8077a2e3ff46729665b");
  EQUAL(hmac(Bytes(131, 0xaa), text("Test Using Larger Than Block-Size Key - Hash Key First")),
        "60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54");
  EQUAL(hmac(Bytes(131, 0xaa), text("This is a test using a larger than block-size key and a larger than block-size "
                                    "data. The key needs to be hashed before being used by the HMAC algorithm.")),
        "9b09ffa71b942fcb27635fbcd5b0e944bfdc63644f0713938a7f51535c3a35e2");
}

TEST(keys_are_64_hexadecimal_digits) {
  uint8_t key[patrol::kKeySize];
  CHECK(patrol::parseKey("00112233445566778899aAbBcCdDeEfF00112233445566778899aabbccddeeff", key));
  EQUAL(unit::hex(Bytes(key, key + 32)), "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff");
  CHECK(!patrol::parseKey("", key));
  CHECK(!patrol::parseKey("0011", key));
  CHECK(!patrol::parseKey("0g112233445566778899aabbccddeeff00112233445566778899aabbccddeeff", key));
  CHECK(!patrol::parseKey("00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff0", key));
}

TEST(proof_has_the_agreed_form) {
  // HMACs of this key, these nonces and this id by Python's hmac.
  Bytes key(32, 0x42), challenge(33, 0x11), nonce(16, 0x22), proof(patrol::kProofSize);
  challenge[0] = 1;
  patrol::KeyProof exchange;
  CHECK(exchange.answer(key.data(), 5, challenge.data(), challenge.size(), nonce.data(), proof.data()));
  EQUAL(unit::hex(proof),
        "0205" + unit::hex(nonce) + "42a4137469b20eae63c41aa9b703d54557a36aaa1ac554f672c8509684ff254a");
  Bytes answer = bytes("02 3bda6f94d7a86a73d4b6692ea8e48fe279a180594880f7924cbf532de9a6e5b8");
  CHECK(exchange.bridgeProves(answer.data(), answer.size()));
  for (size_t i = 0; i < answer.size(); ++i) {
    Bytes wrong = answer;
    wrong[i] = static_cast<uint8_t>(wrong[i] ^ 1);
    CHECK(!exchange.bridgeProves(wrong.data(), wrong.size()));
  }
  CHECK(!exchange.bridgeProves(answer.data(), answer.size() - 1));
  EQUAL(unit::hex(Bytes(exchange.session(), exchange.session() + patrol::kDigestSize)),
        "5660dc9739593224577cc41ea034220e935d18e98f16fe8e193817b78090dbf2");
  exchange.clear();
  CHECK(!exchange.bridgeProves(answer.data(), answer.size()));
}

TEST(frames_are_signed_in_the_agreed_form) {
  const Bytes session = bytes("5660dc9739593224577cc41ea034220e935d18e98f16fe8e193817b78090dbf2");
  const Bytes data = {5, 1};
  patrol::SignedFrames sender, receiver, other;
  sender.begin(session.data(), "from the sensor");
  receiver.begin(session.data(), "from the sensor");
  other.begin(session.data(), "from the bridge");
  Bytes payload = data;
  payload.resize(data.size() + patrol::kSignatureSize);
  sender.sign(125, data.data(), data.size(), payload.data() + data.size());
  EQUAL(unit::hex(payload), "0501" "0000000078503205e6fc32a6");
  CHECK(receiver.isNext(125, payload.data(), payload.size()));
  CHECK(!receiver.isNext(126, payload.data(), payload.size()));
  CHECK(!other.isNext(125, payload.data(), payload.size()));
  for (size_t i = 0; i < payload.size(); ++i) {
    Bytes wrong = payload;
    wrong[i] = static_cast<uint8_t>(wrong[i] ^ 0x10);
    CHECK(!receiver.isNext(125, wrong.data(), wrong.size()));
    CHECK(!receiver.isNext(125, payload.data(), i));
  }
  receiver.advance();
  CHECK(!receiver.isNext(125, payload.data(), payload.size()));  // the same frame again
  sender.advance();
  sender.sign(125, data.data(), data.size(), payload.data() + data.size());
  EQUAL(unit::hex(payload), "0501" "0100000057d1152f7f441e7c");
  CHECK(receiver.isNext(125, payload.data(), payload.size()));
}

TEST(challenges_of_another_form_are_not_answered) {
  Bytes key(32, 0x42), challenge(33, 0x11), nonce(16, 0x22), proof(patrol::kProofSize);
  patrol::KeyProof exchange;
  CHECK(!exchange.answer(key.data(), 5, challenge.data(), challenge.size(), nonce.data(), proof.data()));
  challenge[0] = 1;
  CHECK(!exchange.answer(key.data(), 5, challenge.data(), 32, nonce.data(), proof.data()));
  CHECK(!exchange.answer(key.data(), 5, challenge.data(), 0, nonce.data(), proof.data()));
}
